"""The end of a search: what is left of a formula stands in its place on the front, and says what went."""

import json
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from fitters.expressions import parse
from gpsearch.configuration import Configuration
from gpsearch.exports import schema
from gpsearch.genomes import Genome, reify
from gpsearch.run import Store, result_of
from gpsearch.search.references import unfinished
from tests.gpsearch.small import Watching, gpsearch, run_search, small, without_times
from workers import Done, Failure
from workers.local import LocalExecutor

TOLERANCE = 0.02


def culling(folder: Path, tolerance: float = TOLERANCE) -> Configuration:
    quick = {"starts": 32, "restarts": 1, "rounds": 1}
    return small(folder, culling=tolerance, budget={"generations": 2}, search={"start": "phong"}, fit=quick)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a finished run, `run`."""
    folder = tmp_path_factory.mktemp("culling")
    run_search(folder / "run", culling(folder)).close()
    return folder


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the same run without culling."""
    folder = tmp_path_factory.mktemp("without")
    run_search(folder / "run", culling(folder, 0)).close()
    return folder


def exported(run: Path, tolerance: float = TOLERANCE) -> dict[str, Any]:
    store = Store.open(run)
    found = result_of(store, culling(run.parent, tolerance)).to_json()
    store.close()
    return found


def test_what_is_left_is_smaller_and_says_what_went_and_what_it_cost(folder):
    front = exported(folder / "run")["front"]
    members = {member.expression: member for member in Store.open(folder / "run").front().members}
    culled = [formula for formula in front if "culled" in formula]
    assert culled
    for formula in culled:
        before = formula["culled"]
        assert members[before["from"]].nodes == before["nodes"] == parse(before["from"]).nodes
        assert reify(Genome.from_json(formula["start"], formula["genome"])) == parse(before["from"])
        assert parse(formula["expression"]).nodes == formula["nodes"] < before["nodes"]
        assert parse(formula["expression"]).parameters == tuple(formula["parameters"])
        assert formula["error"] <= (1 + TOLERANCE) * before["error"]
        sizes = [before["nodes"], *(step["nodes"][1] for step in before["steps"])]
        assert (sizes, sizes[-1]) == (sorted(sizes, reverse=True), formula["nodes"])


def test_the_export_is_a_front_that_fulfils_the_schema(folder):
    found = json.loads(json.dumps(exported(folder / "run")))
    jsonschema.validate(found, schema(), jsonschema.Draft202012Validator)
    for smaller, larger in pairwise(found["front"]):
        assert smaller["nodes"] < larger["nodes"]
        assert smaller["error"] > larger["error"]
    culled = next(formula for formula in found["front"] if "culled" in formula)
    for key, value in (("steps", []), ("nodes", 0), ("surprise", 1)):
        kept, culled["culled"] = culled["culled"], culled["culled"] | {key: value}
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(found, schema(), jsonschema.Draft202012Validator)
        culled["culled"] = kept


def test_no_member_is_worse_off_than_the_tolerance_says(folder, without):
    """A run without culling has the same members; something no larger is about as good as each of them."""
    members, front = exported(without / "run", 0)["front"], exported(folder / "run")["front"]
    assert not any("culled" in formula for formula in members)
    originals = {formula["culled"]["from"] for formula in front if "culled" in formula}
    assert not any(formula["expression"] in originals for formula in front)
    for member in members:
        assert any(
            f["nodes"] <= member["nodes"] and f["error"] <= (1 + TOLERANCE) * member["error"] for f in front
        )


class Counting(LocalExecutor):
    """Counts what it computes by label."""

    def __init__(self) -> None:
        super().__init__()
        self.computed: Counter[str] = Counter()

    def wait(self, seconds):
        done = super().wait(seconds)
        self.computed.update(one.job.label for one in done)
        return done


def test_what_is_culled_is_not_culled_again(folder, tmp_path):
    """Stopped while the front is culled, the run goes on with the others, and exports the same."""

    class StopsInTheMidst(LocalExecutor):
        culled = 0

        def wait(self, seconds):
            done = super().wait(seconds)
            self.culled += sum(one.job.label == "cull front" for one in done)
            if self.culled > 2:
                raise KeyboardInterrupt
            return done

    with pytest.raises(KeyboardInterrupt):
        run_search(tmp_path / "run", culling(tmp_path), executor=StopsInTheMidst())
    store = Store.open(tmp_path / "run")
    assert sum(culled is not None for culled in store.culled().values()) == 2
    counting, watcher = Counting(), Watching()
    run_search(tmp_path / "run", culling(tmp_path), watcher, counting).close()
    assert counting.computed["cull front"] == len(store.front().members) - 2
    assert counting.computed["describe front"] == 0
    assert without_times(exported(tmp_path / "run")) == without_times(exported(folder / "run"))
    again = Counting()
    run_search(tmp_path / "run", culling(tmp_path), executor=again).close()
    assert again.computed == Counter()


def test_export_culls_a_run_that_was_stopped(folder, tmp_path):
    def stop(event: str) -> None:
        if event == "describing the front":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_search(tmp_path / "run", culling(tmp_path), Watching(stop))
    result = gpsearch("export", "run", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert without_times(json.loads(result.stdout)) == without_times(exported(folder / "run"))


def test_a_run_of_a_version_without_culling_is_exported_as_it_is(without):
    """Its descriptions do not say that they are to be culled, though its configuration now does by default."""
    store = Store.open(without / "run")
    assert unfinished(store, store.front().members) == []
    assert store.culled() == {}
    assert exported(without / "run")["front"] == exported(without / "run", 0)["front"]
    store.close()


def test_a_formula_that_cannot_be_culled_stays_as_it_is_until_it_can(folder, tmp_path):
    class Sick(LocalExecutor):
        def wait(self, seconds):
            return [
                Done(one.job, one.index, Failure("raised OSError: stale")) if one.job.kind == "cull" else one
                for one in super().wait(seconds)
            ]

    store = run_search(tmp_path / "run", culling(tmp_path), executor=Sick())
    assert {one.stage for one in store.quarantined()} == {"cull"}
    assert exported(tmp_path / "run")["front"]
    assert not any("culled" in formula for formula in exported(tmp_path / "run")["front"])
    run_search(tmp_path / "run", culling(tmp_path)).close()
    assert without_times(exported(tmp_path / "run")) == without_times(exported(folder / "run"))
