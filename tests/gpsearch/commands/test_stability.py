"""`gpsearch stability`: what it leaves, what it says, and how it ends."""

import json

import pytest

from fitters.stability import HAZARDS, METHODS
from tests.gpsearch.small import gpsearch

NEW = ("stability", "--methods", "bivariate,power-iterations", "--hazards", "backscattering", "--seeds", "1")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stability")
    found = gpsearch(*NEW, "--json", "-o", "out", cwd=folder)
    assert found.returncode == 0, found.stderr
    return folder, json.loads(found.stdout)


def test_the_report_is_the_file(result):
    folder, report = result
    assert json.loads((folder / "out/stability.json").read_text()) == report
    assert (folder / "out/stability.png").read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in (folder / "out/stability.svg").read_bytes()


def test_every_method_meets_every_level(result):
    _, report = result
    cells = {(cell["method"], cell["hazard"], cell["level"]): cell for cell in report["cells"]}
    assert len(cells) == 2 * (1 + len(HAZARDS["backscattering"].levels)) == len(report["cells"])
    missing = cells["power-iterations", "backscattering", "missing"]
    assert (missing["rate"], missing["how"], missing["silent"]) == (1, ["raised"], False)
    assert missing["errors"] == {"light": None, "compressive": None}
    # The bivariate table takes a cell without a sample from its neighbours.
    assert cells["bivariate", "backscattering", "missing"]["rate"] == 0


def test_failing_cells_have_a_line_each_and_what_is_left_out_is_said(result):
    _, report = result
    assert len(report["lines"]) == sum(cell["rate"] > 0 for cell in report["cells"])
    assert any("power-iterations, backscattering (missing): it refuses" in line for line in report["lines"])
    (methods, hazards) = report["skipped"][:2]
    assert "npf-naive" in methods
    assert "fireflies" in hazards


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--methods", "bivariat"), "bivariate"),
        (("--hazards", "noise,none"), "none is not among"),
        (("--seeds", "0"), "--seeds"),
        (("--material", "missing.binary"), "missing.binary"),
    ],
)
def test_bad_input_is_one_message_and_exit_status_2(tmp_path, arguments, words):
    found = gpsearch("stability", *arguments, cwd=tmp_path)
    assert (found.returncode, found.stdout) == (2, "")
    assert words in found.stderr
    assert "Traceback" not in found.stderr


def test_help_lists_what_there_is(tmp_path):
    shown = gpsearch("stability", "--help", cwd=tmp_path).stdout
    assert all(name in shown for name in (*METHODS, *HAZARDS))
