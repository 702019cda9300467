"""The container file, by hadolint and by what it must say; no image is built."""

import re
import subprocess
import tomllib

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from tests.deploy.paths import DEPLOY, REPOSITORY, installed

CONTAINER = DEPLOY / "container"


def instructions() -> list[tuple[str, str]]:
    """(name, arguments) of every instruction, comments and continuations taken away."""
    text = re.sub(r"^#.*\n", "", (CONTAINER / "Dockerfile").read_text(), flags=re.MULTILINE)
    lines = re.sub(r"\\\n\s*", "", text).splitlines()
    return [(name, arguments) for name, _, arguments in (line.partition(" ") for line in lines if line)]


def test_hadolint_finds_nothing() -> None:
    done = subprocess.run(
        [installed("hadolint"), CONTAINER / "Dockerfile"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "")


def test_every_base_image_is_pinned_to_a_full_version() -> None:
    images = [arguments.split()[0] for name, arguments in instructions() if name == "FROM"]
    assert images
    assert all(re.fullmatch(r"python:\d+\.\d+\.\d+-slim-[a-z]+(@sha256:[0-9a-f]{64})?", image) for image in images)


def test_it_runs_as_a_fixed_user_other_than_root() -> None:
    last = [arguments for name, arguments in instructions() if name == "USER"][-1]
    assert re.fullmatch(r"[1-9]\d*:[1-9]\d*", last)
    after = [name for name, _ in instructions()][-4:]
    assert "RUN" not in after[after.index("USER") :]


def test_any_command_can_be_given() -> None:
    assert "ENTRYPOINT" not in dict(instructions())


def test_the_cache_lies_on_a_volume() -> None:
    assert "GPSEARCH_CACHE=/cache" in dict(instructions())["ENV"].split()
    assert '"/cache"' in dict(instructions())["VOLUME"]


def test_the_lock_holds_every_dependency_in_a_version_that_is_new_enough() -> None:
    lines = (CONTAINER / "requirements.lock").read_text().splitlines()
    pairs = [line.split("==") for line in lines if not line.startswith("#")]
    locked = {canonicalize_name(name): Version(version) for name, version in pairs}
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    for text in project["dependencies"]:
        requirement = Requirement(text)
        assert requirement.specifier.contains(locked[canonicalize_name(requirement.name)]), text


def test_what_is_copied_is_let_through_by_dockerignore() -> None:
    let_through = {
        line[1:] for line in (REPOSITORY / ".dockerignore").read_text().splitlines() if line.startswith("!")
    }
    copied: set[str] = set()
    for name, arguments in instructions():
        if name == "COPY" and not arguments.startswith("--from"):
            copied.update(arguments.split()[:-1])
    assert copied == let_through
    assert all((REPOSITORY / path).exists() for path in copied)
