"""The contract of export targets: `check_target(target, result)` asserts what every entry of `TARGETS` must do."""

import re
from dataclasses import replace

from gpsearch.exports.targets import Files, Target
from gpsearch.run import Result

RESERVED = re.compile(r"\b(nan|inf|infinity)\b", re.IGNORECASE)
"""Numbers that are not finite, which no other program can be expected to read."""


def check_target(target: Target, result: Result) -> None:
    """All checks on a result with two or more formulas; raises `AssertionError` that names the target."""
    name = target.name
    assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name), f"{name!r}: a name is like front-json"
    assert target.meaning.strip(), f"{name}: the help does not say what it writes"
    before = result.to_text()
    files = target.files(result, result.formulas)
    assert files, f"{name}: writes no file"
    for file, text in files.items():
        check_file(name, file, text)
    assert dict(target.files(result, result.formulas)) == dict(files), f"{name}: the same result gives other files"
    assert result.to_text() == before, f"{name}: changes the result"
    check_members(target, result, files)


def check_file(name: str, file: str, text: str) -> None:
    """A plain file name, and text that ends with its last line and holds only finite numbers."""
    assert re.fullmatch(r"[\w-][\w.-]*\.\w+", file), f"{name}: {file!r} is not a plain file name with a suffix"
    assert text.endswith("\n"), f"{name}: {file} does not end with a line"
    assert not text.endswith("\n\n"), f"{name}: {file} ends with an empty line"
    number = RESERVED.search(text)
    assert number is None, f"{name}: {file} holds {number and number[0]}, which is not a finite number"


def check_members(target: Target, result: Result, files: Files) -> None:
    """Each formula has its own files, which do not depend on the others; a run without formulas can be written."""
    name, empty = target.name, replace(result, formulas=())
    if not target.per_member:
        assert target.files(empty, ()), f"{name}: does not write a run without formulas"
        return
    assert not target.files(empty, ()), f"{name}: writes files for no formula"
    together: dict[str, str] = {}
    for formula in result.formulas:
        alone = target.files(result, [formula])
        assert alone, f"{name}: writes no file for {formula.name}"
        assert not alone.keys() & together.keys(), f"{name}: two formulas have a file of one name"
        together |= alone
    assert together == dict(files), f"{name}: the files of a formula depend on which others are written"
