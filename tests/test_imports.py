"""What is imported when, and from where: the command line answers before the heavy libraries are there."""

import ast
import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import click
import pytest

from gpsearch.commands.group import COMMANDS, commands

HEAVY = ("numpy", "numba", "scipy", "dask", "distributed", "sympy", "matplotlib", "plotly", "pydantic", "skimage")
ROOT = Path(__file__).parents[1]
PACKAGES = ("fitters", "workers", "gpsearch")
BY_ANOTHER = {"llvmlite": "numba", "pydantic-core": "pydantic"}
"""Libraries that belong to another one, which fixes their version."""


def imported_by(*arguments: str) -> set[str]:
    """Of the heavy libraries, those that `gpsearch` with these arguments imports, in a process of its own."""
    code = (
        "import atexit, sys; from gpsearch.commands import main;"
        "atexit.register(lambda: print('imported', *sys.modules, file=sys.stderr)); main()"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=60, check=True
    )
    modules = result.stderr.splitlines()[-1].split()
    assert "gpsearch.commands.group" in modules
    return set(HEAVY) & set(modules)


@pytest.mark.parametrize("arguments", [("--version",), ("--help",), ("-h",)])
def test_the_command_line_answers_without_heavy_libraries(arguments):
    assert imported_by(*arguments) == set()


@pytest.mark.parametrize("command", ["status", "export", "materials"])
def test_a_command_that_draws_nothing_imports_no_library_for_pictures(command):
    assert imported_by(command, "--help") & {"matplotlib", "plotly", "dask", "distributed", "sympy"} == set()


@pytest.mark.parametrize("name", COMMANDS)
def test_every_listed_command_is_there_under_its_name(name):
    command = commands.get_command(click.Context(commands), name)
    assert command is not None
    assert (command.name, bool(command.help)) == (name, True)


def test_a_command_that_is_not_there_is_refused():
    with pytest.raises(click.UsageError, match="No such command 'nothing'"):
        commands.main(["nothing"], standalone_mode=False)


def plain(name: str) -> str:
    """The name of a distribution without bounds, as package indices compare it."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", name)[0]).lower()


def libraries(folder: str) -> set[str]:
    """The distributions whose modules the files of a folder import, but the standard library and our own."""
    modules = set()
    for path in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                modules |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                modules.add(node.module.partition(".")[0])
    modules -= {*sys.stdlib_module_names, *PACKAGES, "tests"}
    by_module = packages_distributions()
    return {plain(by_module.get(module, [module])[0]) for module in modules}


def test_the_libraries_of_the_project_are_those_that_it_imports():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    required = {plain(name) for name in project["dependencies"]}
    extras = {name: {plain(one) for one in needed} for name, needed in project["optional-dependencies"].items()}
    imported = {BY_ANOTHER.get(name, name) for folder in PACKAGES for name in libraries(folder)}
    # The contract suites in fitters.testing and workers.testing are for those who have pytest.
    assert imported - extras["mitsuba"] - {"pytest"} == required
    in_tests = {BY_ANOTHER.get(name, name) for name in libraries("tests")}
    assert in_tests - required - extras["benchmark"] <= extras["test"]


ABOVE = {"fitters": {"workers", "gpsearch"}, "workers": {"gpsearch"}}
"""What a package must not import: the floors above it."""


@pytest.mark.parametrize("package", ABOVE)
def test_imports_go_down(package):
    for path in sorted((ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            upwards = [name for name in names if name.partition(".")[0] in ABOVE[package]]
            assert not upwards, f"{path}: {upwards}"
