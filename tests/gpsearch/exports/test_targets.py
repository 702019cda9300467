"""Registered targets pass the contract, which finds broken ones; `gpsearch export` writes their files."""

from dataclasses import replace

import pytest
from click.testing import CliRunner

from gpsearch.commands import export as command
from gpsearch.errors import GpsearchError
from gpsearch.exports import TARGETS
from gpsearch.exports.contract import check_target
from gpsearch.exports.targets import Target, of_member, of_run
from tests.gpsearch.entries import baseline, formula, result

RESULT = result(
    formula("f00d", 0.3, 5), formula("beef", 0.2, 9), baseline("bivariate", 0.1), baseline("dark", None)
)
SHEETS = of_member("sheets", "a line for each formula", ".txt", lambda _, one: f"{one.name} {one.expression}\n")


@pytest.mark.parametrize("name", TARGETS)
def test_registered_targets_pass(name):
    check_target(TARGETS[name], RESULT)


def test_a_target_with_a_file_for_each_formula_passes():
    check_target(SHEETS, RESULT)
    assert list(SHEETS.files(RESULT, RESULT.formulas)) == ["f00d.txt", "beef.txt"]


class Counter:
    count = 0

    def __call__(self, found):
        self.count += 1
        return f"{self.count}\n"


BROKEN = {
    "a name": (replace(SHEETS, name="Sheets"), "a name is like"),
    "no meaning": (replace(SHEETS, meaning=" "), "help"),
    "no file": (replace(SHEETS, files=lambda found, formulas: {}), "writes no file"),
    "a path": (of_run("x", "x", "../x.txt", lambda _: "x\n"), "not a plain file name"),
    "no last line": (of_run("x", "x", "x.txt", lambda _: "x"), "does not end with a line"),
    "infinity": (of_run("x", "x", "x.txt", lambda _: "albedo Infinity\n"), "holds Infinity"),
    "other files": (of_run("x", "x", "x.txt", Counter()), "gives other files"),
    "one name": (
        Target("x", "x", lambda _, some: {"x.txt": "x\n"} if some else {}, per_member=True),
        "of one name",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_target_is_found(case):
    target, message = BROKEN[case]
    with pytest.raises(AssertionError, match=message):
        check_target(target, RESULT)


@pytest.fixture
def sheets(monkeypatch):
    """The command with a target for each formula, on a result that is there."""
    monkeypatch.setitem(TARGETS, "sheets", SHEETS)
    monkeypatch.setattr(command, "described", lambda run: RESULT)
    option = next(one for one in command.export.params if one.name == "name")
    monkeypatch.setattr(option.type, "choices", (*TARGETS,))
    return lambda *arguments: CliRunner().invoke(command.export, ["run", *map(str, arguments)])


def test_one_member_goes_to_standard_output_and_all_into_a_folder(sheets, tmp_path):
    assert sheets("--format", "sheets", "--member", "beef").stdout == "beef p0\n"
    assert sheets("--format", "sheets", "-o", tmp_path / "all").exit_code == 0
    assert {path.name: path.read_text() for path in (tmp_path / "all").iterdir()} == {
        "f00d.txt": "f00d p0\n",
        "beef.txt": "beef p0\n",
    }
    assert sheets("--format", "sheets", "--member", "f00d", "-o", tmp_path / "one.txt").exit_code == 0
    assert (tmp_path / "one.txt").read_text() == "f00d p0\n"


def test_a_baseline_is_written_where_it_is_named(sheets):
    assert sheets("--format", "sheets", "--member", "bivariate").stdout == "bivariate None\n"


def test_a_member_that_is_not_there_is_refused_with_those_that_are(sheets):
    error = sheets("--format", "sheets", "--member", "cafe").exception
    assert isinstance(error, GpsearchError)
    assert "no model 'cafe'; there are f00d, beef, bivariate, dark" in str(error)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--format", "sheets"), "2 files need a folder"),
        (("--member", "beef"), "json is about the whole run"),
        (("--format", "xml"), "'xml' is not one of 'json', "),
    ],
)
def test_a_wrong_request_says_what_to_do(sheets, arguments, message):
    outcome = sheets(*arguments)
    assert outcome.exit_code == 2
    assert message in outcome.output
