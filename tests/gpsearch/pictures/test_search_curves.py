"""What the front was at every time of a search: it agrees with what the search told, and with what is stored."""

import json
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsearch.errors import GpsearchError
from gpsearch.pictures.search_chart import grouped, median_points
from gpsearch.pictures.search_curves import Curve, FrontStep, Reference, SearchedRun, curves, hypervolume
from gpsearch.run import Front, Generation, Store, non_dominated
from gpsearch.run.records import read_stages
from tests.gpsearch.small import Watching, make_store, run_search, small, writing

SIZE = 40
REFERENCE = Reference(SIZE, 1.0)

points = st.lists(st.tuples(st.integers(1, SIZE + 5), st.floats(0, 1.2)), max_size=12)


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    """A finished search, and what it told on its way."""
    folder, watcher = tmp_path_factory.mktemp("curves"), Watching()
    configuration = small(folder, baselines=[], budget={"generations": 6})
    store = run_search(folder / "run", configuration, watcher)
    yield SearchedRun.of(folder / "run", store, configuration), watcher, store
    store.close()


@given(points)
def test_a_front_is_what_no_other_point_beats(members):
    front = non_dominated(members, lambda point: point)
    for nodes, error in members:
        assert any(n <= nodes and e <= error for n, e in front)
    for (small_nodes, large_error), (large_nodes, small_error) in pairwise(front):
        assert small_nodes < large_nodes
        assert small_error < large_error


@given(points)
def test_a_hypervolume_is_the_area_counted_node_by_node(members):
    """Sizes are whole, so that the best error up to every size, column by column, is the area itself."""
    best = [min([1.0, *(e for n, e in members if n <= column)]) for column in range(SIZE)]
    area = sum(1.0 - error for error in best) / SIZE
    assert hypervolume(non_dominated(members, lambda point: point), REFERENCE) == pytest.approx(area, abs=1e-12)


def test_errors_never_rise_and_hypervolumes_never_fall(watched):
    run, _, store = watched
    (curve,) = curves([run])
    assert len(curve.steps) > 2
    for one, next_one in pairwise(curve.steps):
        assert one.seconds < next_one.seconds
        assert one.error >= next_one.error
        assert one.hypervolume <= next_one.hypervolume
    assert curve.steps[0].seconds > 0
    assert curve.steps[-1].seconds <= curve.seconds == store.seconds


def test_a_curve_ends_at_the_stored_front(watched):
    """Of which the store has dropped what was beaten on the way."""
    run, _, store = watched
    (curve,) = curves([run])
    members, last = store.front().members, curve.steps[-1]
    assert (last.error, last.nodes, last.members) == (members[-1].error, members[-1].nodes, len(members))
    assert curve.candidates == store.totals()[1]


def test_a_curve_is_what_the_search_told_on_its_way(watched):
    run, watcher, _ = watched
    (curve,) = curves([run])
    assert len(watcher.statuses) == 6
    for status in watcher.statuses:
        step, front = curve.at(status.seconds), status.front
        assert (step.error, step.members) == (front.members[-1].error, len(front.members))


def test_the_time_of_a_run_that_was_stopped_goes_on(tmp_path):
    configuration = small(tmp_path, baselines=[])

    def stop(event: str) -> None:
        if event == "stored 2":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_search(tmp_path / "run", configuration, Watching(stop))
    left = Store.open(tmp_path / "run")
    before = left.seconds
    left.close()
    store = run_search(tmp_path / "run", configuration)
    later = [g.at for g in store.generations() if g.generation > 2]
    assert later
    assert all(before < at <= store.seconds for at in later)


def generation(at, arrived):
    return Generation(0, 1, 16, 16, 0, 1, 0.5, 1.0, {}, at, arrived)


def run_of(folder, arrived, seconds=10.0, at=1.0, **changes):
    folder.mkdir(exist_ok=True)
    return SearchedRun(folder, small(folder, **changes), None, (generation(at, arrived),), seconds)


def test_an_error_is_reached_when_something_first_has_it(tmp_path):
    steps = (FrontStep(1.0, 0.5, 5, 0.1, 1), FrontStep(4.0, 0.2, 9, 0.2, 2))
    curve = Curve(tmp_path, "a", 0, 10.0, 100, steps)
    assert [curve.first_below(error) for error in (0.6, 0.5, 0.3, 0.1)] == [1.0, 1.0, 4.0, None]
    assert [curve.at(seconds) for seconds in (0.5, 1.0, 3.9, 9.0)] == [None, steps[0], steps[0], steps[1]]


def test_the_median_of_repetitions_counts_while_all_of_them_run(tmp_path):
    def curve(seconds, *steps):
        return Curve(tmp_path, "a", 0, seconds, 1, tuple(FrontStep(at, error, 5, 0.1, 1) for at, error in steps))

    repetitions = [curve(10, (1, 0.5), (3, 0.1)), curve(9, (2, 0.4)), curve(20, (1, 0.9), (4, 0.3))]
    assert median_points(repetitions) == ([2, 3, 4, 9], [0.5, 0.4, 0.3, 0.3])


def test_repetitions_have_one_name_and_other_searches_their_folders_too(tmp_path):
    arrived = ((5, 0.5),)
    runs = [run_of(tmp_path / "a", arrived, seed=1), run_of(tmp_path / "b", arrived, seed=2)]
    assert list(grouped(curves(runs))) == ["small"]
    runs.append(run_of(tmp_path / "c", arrived, fit={"warm_starts": False}))
    assert list(grouped(curves(runs))) == ["small (a)", "small (b)", "small (c)"]


def test_runs_on_other_materials_are_not_compared(tmp_path):
    runs = [run_of(tmp_path / "a", ((5, 0.5),)), run_of(tmp_path / "b", ((5, 0.5),), materials=["builtin:fabric"])]
    with pytest.raises(
        GpsearchError, match=r"b: its errors cannot be compared .*materials: fabric instead of metal"
    ):
        curves(runs)


def test_a_run_of_a_version_that_noted_no_times_is_refused(tmp_path):
    """Its history holds the stages alone, in the column where times are now."""
    configuration = small(tmp_path, baselines=[], budget={"generations": 1})
    store = run_search(tmp_path / "run", configuration)
    with writing(tmp_path / "run") as older, older.transaction():
        for row in older.generations():
            older._connection.execute("UPDATE generations SET stages = ?", (json.dumps(row.stages),))
    assert all((row.at, row.arrived) == (None, ()) and row.stages for row in store.generations())
    with pytest.raises(
        GpsearchError, match="did not note when the front was found; launch its configuration again"
    ):
        SearchedRun.of(tmp_path / "run", store, configuration)
    store.close()


def test_stages_of_both_forms_are_read():
    assert read_stages('{"screening": 1.5}') == {"stages": {"screening": 1.5}}
    stored = {"stages": {"screening": 1.5}, "at": 3.0, "arrived": [[5, 0.25]]}
    assert read_stages(json.dumps(stored)) == {**stored, "arrived": ((5, 0.25),)}


def test_a_run_without_a_front_is_refused(tmp_path):
    store = Store.open(make_store(tmp_path, ""))
    assert store.front() == Front()
    with pytest.raises(GpsearchError, match="no front yet; `gpsearch launch` goes on with it"):
        SearchedRun.of(tmp_path, store, small(tmp_path))
    store.close()
