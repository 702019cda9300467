"""Commands that read a run while another process writes to it."""

import json
import sqlite3

import pytest

from gpsearch.run import Store
from tests.gpsearch.run.test_lock import launcher
from tests.gpsearch.small import Watching, gpsearch, run_search, small


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with `run`, of which no formula is described."""
    folder = tmp_path_factory.mktemp("live")

    def stop(event: str) -> None:
        if event == "describing the front":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_search(folder / "run", small(folder, budget={"generations": 1}), Watching(stop))
    return folder


def content(folder):
    with sqlite3.connect(folder / "run" / "run.sqlite") as connection:
        return list(connection.iterdump())


def test_a_run_that_is_written_to_is_read_as_far_as_it_is_described(folder):
    before, count = content(folder), len(Store.open(folder / "run").front().members)
    assert count > 0
    with launcher(folder / "run") as (process, _):
        exported = gpsearch("export", "run", cwd=folder)
        charted = gpsearch("chart", "run", cwd=folder)
    assert exported.returncode == 0, exported.stderr
    report = json.loads(exported.stdout)
    assert (report["front"], [one["name"] for one in report["baselines"]]) == ([], ["lambert"])
    assert exported.stderr.startswith(f"run: process {process.pid} on ")
    assert f"0 formulas of the front without {count} others" in exported.stderr
    assert "repeat this command when that process has ended" in exported.stderr
    assert charted.returncode == 2
    assert f"none of the {count} formulas of its front is described yet" in charted.stderr
    assert content(folder) == before


def test_it_is_described_once_the_other_process_has_ended(folder):
    count = len(Store.open(folder / "run").front().members)
    exported = gpsearch("export", "run", cwd=folder)
    assert exported.returncode == 0, exported.stderr
    assert 0 < len(json.loads(exported.stdout)["front"]) <= count
    assert set(Store.open(folder / "run").descriptions()) == {
        member.expression for member in Store.open(folder / "run").front().members
    }
