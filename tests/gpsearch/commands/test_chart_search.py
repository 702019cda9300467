"""`gpsearch chart-search`: what it leaves, says and refuses."""

import csv
import json
import re
from xml.etree import ElementTree

import pytest
from matplotlib import image

from gpsearch.run import Store
from tests.gpsearch.small import gpsearch, run_search, small


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with two runs of one search, `first` and `second`, and `slow`, another one."""
    folder = tmp_path_factory.mktemp("chart")
    small_budget = {"generations": 3}
    run_search(folder / "first", small(folder, baselines=[], budget=small_budget)).close()
    run_search(folder / "second", small(folder, baselines=[], budget=small_budget, seed=6)).close()
    changes = {"name": "slow", "fit": {"early_stopping": False}}
    run_search(folder / "slow", small(folder, baselines=[], budget=small_budget, **changes)).close()
    return folder


@pytest.fixture(scope="module")
def charted(folder):
    result = gpsearch("chart-search", "first", "second", "slow", "-o", "out", "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    return folder / "out", json.loads(result.stdout)


def test_all_files_are_there(charted):
    folder, told = charted
    assert sorted(path.name for path in folder.iterdir()) == [
        "search.csv",
        "search.html",
        "search.png",
        "search.svg",
    ]
    assert told["files"] == {form: f"out/search.{form}" for form in ("png", "svg", "html", "csv")}


def test_the_picture_has_something_on_it(charted):
    picture = image.imread(charted[0] / "search.png")
    assert picture.shape[:2] == (750, 1200)
    pixels = (255 * picture[..., :3]).astype(int)
    assert (pixels == (0x1F, 0x5F, 0xA8)).all(axis=2).any()
    assert (pixels == (0xC4, 0x57, 0x2B)).all(axis=2).any()


def test_the_print_version_names_the_searches(charted):
    root = ElementTree.parse(charted[0] / "search.svg").getroot()
    assert root.tag.endswith("svg")
    comments = (charted[0] / "search.svg").read_text()
    assert "<!-- slow -->" in comments
    assert "<!-- small -->" in comments


def test_the_page_needs_no_network(charted):
    text = (charted[0] / "search.html").read_text()
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", text)
    assert '"name":"slow"' in text


def test_the_table_is_the_object_that_is_told(charted):
    folder, told = charted
    with (folder / "search.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["run"]: row["name"] for row in rows} == {"first": "small", "second": "small", "slow": "slow"}
    for run in told["runs"]:
        own = [row for row in rows if row["run"] == run["run"]]
        last = run["steps"][-1] | {"seconds": run["seconds"]}
        for row, step in zip(own, [*run["steps"], last], strict=True):
            assert {key: float(row[key]) for key in step} == step


def test_the_last_error_is_the_stored_front_s(folder, charted):
    for run in charted[1]["runs"]:
        store = Store.open(folder / run["run"])
        assert run["steps"][-1]["error"] == store.front().members[-1].error
        assert (run["seconds"], run["candidates"]) == (store.seconds, store.totals()[1])
        store.close()


def test_without_a_folder_the_first_run_s_has_the_chart(folder):
    result = gpsearch("chart-search", "slow", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert re.match(r"slow, seed 5: error \d\.\d{4} at \d+ nodes after ", result.stdout)
    assert (folder / "slow/search.png").is_file()


def test_no_run_is_bad_input(folder):
    result = gpsearch("chart-search", "first", "nowhere", cwd=folder)
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr == "gpsearch: nowhere: no run here (run.sqlite is missing); `gpsearch launch` makes one\n"
    assert gpsearch("chart-search", cwd=folder).returncode == 2


def test_a_folder_that_cannot_be_written_is_bad_input(folder):
    (folder / "file").touch()
    result = gpsearch("chart-search", "first", "-o", "file", cwd=folder)
    assert result.returncode == 2
    assert result.stderr == "gpsearch: file: cannot be written (File exists); choose another -o\n"
