"""Plain words, and one meaning for every name, in the three packages and their pages."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("fitters", "workers", "gpsearch")

BANNED = {
    r"so many\b": "say the number's name: `count` rows, every n-th azimuth, as many as",
    r"(a|no) gift\b": "say what costs nothing",
    r"flatter": "say too low, too good",
    r"shut the door": "say refuse, exclude",
    r"wits'? end": "say what cannot be done",
    r"t(ell|old) apart": "say distinguish",
    r"(at|to) hand\b": "say available, known, given",
    r"(under way|on (its|their) way)": "say running, in progress, current, halfway",
    r"anew\b": "say again, from the start",
    r"(whoever|whomever|nobody)\b": "name who: a user, a caller, no process",
    r"but for\b": "say except",
    r"save (for|in|where|that)\b": "say except",
    r"nothing but\b": "say only",
    r"next to nothing": "say almost nothing",
    r"to blame": "say the cause",
    r"smuggle": "say contain",
    r"torn\b": "say incomplete, damaged, split",
    r"(no matter|as it were|for life|in mid run|comes? of it|spares? (it|that|them))\b": "say it plainly",
    r"mind(s|ed)? (it|them|the)\b": "say supervise",
    r"carried (through|further|furthest|on)": "say completed, finished",
    r"(lest|whence|thereby|thence|ere|nigh|oft|nought|naught|aught)\b": "say it in today's English",
}
"""Turns of speech that a reader whose second language is English has to look up, and what to write instead."""


def sources() -> list[Path]:
    return sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def pages() -> list[Path]:
    places = (*PACKAGES, "deploy")
    below = (path for place in places for path in (ROOT / place).rglob("*") if path.suffix in (".md", ".yaml"))
    return sorted([*below, ROOT / "README.md", *(ROOT / "deploy").rglob("*.py")])


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def banned_turns() -> Iterator[str]:
    patterns = [(re.compile(rf"(?<![\w-]){turn}", re.IGNORECASE), advice) for turn, advice in BANNED.items()]
    for path in (*sources(), *pages()):
        text = path.read_text(encoding="utf-8")
        for pattern, advice in patterns:
            for match in pattern.finditer(text):
                line = text.count("\n", 0, match.start()) + 1
                yield f"{name_of(path)}:{line}: {match[0]!r}: {advice}"


def classes_of_one_name() -> Iterator[str]:
    places = defaultdict(list)
    for path in sources():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{name_of(path)}:{node.lineno}")
    yield from (f"{name}: {', '.join(found)}" for name, found in sorted(places.items()) if len(found) > 1)


def hidden_modules() -> Iterator[str]:
    """Names of a package that hide a module of it: `from package import module` then gives something else."""
    for path in sources():
        if path.name != "__init__.py":
            continue
        package = ".".join(path.parent.relative_to(ROOT).parts)
        modules = {file.stem for file in path.parent.glob("*.py")}
        modules |= {file.parent.name for file in path.parent.glob("*/__init__.py")}
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            names = set()
            if isinstance(node, ast.ImportFrom) and node.module != package:
                names = {alias.asname or alias.name for alias in node.names}
            elif isinstance(node, ast.FunctionDef | ast.ClassDef):
                names = {node.name}
            yield from (f"{name_of(path)}: {name}" for name in sorted(names & modules))


def variables_called_found() -> Iterator[str]:
    for path in sources():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Name) and node.id == "found" and isinstance(node.ctx, ast.Store):
                yield f"{name_of(path)}:{node.lineno}: `found`: name what was found: fit, optimum, matches"


CHECKS = (banned_turns, classes_of_one_name, hidden_modules, variables_called_found)


@pytest.mark.parametrize("check", CHECKS)
def test_names_and_words(check):
    problems = list(check())
    assert not problems, "\n".join(problems)


if __name__ == "__main__":
    for check in CHECKS:
        print(f"\n{check.__name__}", *check(), sep="\n")
