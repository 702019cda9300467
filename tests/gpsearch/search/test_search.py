"""The search as a whole: what it tells, what it stores, and that stopping changes nothing."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fitters.expressions import parse, to_text
from fitters.expressions.canonical import canonical
from fitters.expressions.catalogue import CATALOGUE
from gpsearch.errors import GpsearchError
from gpsearch.exports import front_json
from gpsearch.front import Store
from gpsearch.front.front import SAME
from gpsearch.genomes import reify
from gpsearch.search.plan import plan
from gpsearch.search.search import Search
from tests.gpsearch.small import Watching, run_search, small, without_times
from workers.local import LocalExecutor

PHONG = to_text(CATALOGUE["phong"].expression)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, tuple[int, int, int], int]:
    """The front of a run never stopped, its totals, and how many steps of work it took."""
    folder = tmp_path_factory.mktemp("uninterrupted")
    watcher = Watching()
    store = run_search(folder / "run", small(folder), watcher)
    return without_times(front_json(store, small(folder))), store.totals(), watcher.steps


def stop_at(event: str, count: int) -> Callable[[str], None]:
    """Something to call with events that is interrupted, as by Ctrl-C, at the count-th of a name."""
    left = count

    def then(happened: str) -> None:
        nonlocal left
        left -= happened == event
        if not left and happened == event:
            raise KeyboardInterrupt

    return then


@pytest.mark.parametrize(
    ("event", "count"),
    [
        ("baselines", 1),
        ("generation 1", 1),
        ("step", 4),
        ("confirming", 1),
        ("stored 1", 1),
        ("step", 12),
        ("stored 2", 1),
        ("confirming", 3),
        ("stored 4", 1),
        ("describing the front", 1),
    ],
)
def test_a_run_that_was_stopped_anywhere_gives_the_same_front(tmp_path, uninterrupted, event, count):
    exported, totals, steps = uninterrupted
    before, after = Watching(stop_at(event, count)), Watching()
    with pytest.raises(KeyboardInterrupt):
        run_search(tmp_path / "run", small(tmp_path), before)
    store = run_search(tmp_path / "run", small(tmp_path), after)
    assert without_times(front_json(store, small(tmp_path))) == exported
    assert store.totals() == totals
    assert before.steps + after.steps >= steps


def test_a_run_that_is_stopped_at_every_generation_gives_the_same_front(tmp_path, uninterrupted):
    for generation in range(1, 5):
        with pytest.raises(KeyboardInterrupt):
            run_search(tmp_path / "run", small(tmp_path), Watching(stop_at(f"stored {generation}", 1)))
    store = run_search(tmp_path / "run", small(tmp_path))
    assert without_times(front_json(store, small(tmp_path))) == uninterrupted[0]
    assert store.totals() == uninterrupted[1]


def test_a_larger_budget_goes_on_as_if_it_had_been_given_at_once(tmp_path, uninterrupted):
    run_search(tmp_path / "run", small(tmp_path, budget={"generations": 2}))
    store = run_search(tmp_path / "run", small(tmp_path))
    assert without_times(front_json(store, small(tmp_path))) == uninterrupted[0]


class Counting(LocalExecutor):
    """An executor that counts the candidates that it fits, by label."""

    def __init__(self) -> None:
        self.fitted: Counter[str] = Counter()

    def run(self, function, recipe, payloads, *, label):
        self.fitted[label] += 0
        for index, result in super().run(function, recipe, payloads, label=label):
            self.fitted[label] += len(result) if isinstance(result, list) else 1
            yield index, result


@pytest.mark.parametrize("event", ["confirming", "stored 2"])
def test_nothing_that_was_fitted_is_fitted_again(tmp_path, event):
    """What a generation had screened when it was broken off is known to the next session."""
    with pytest.raises(KeyboardInterrupt):
        run_search(tmp_path / "run", small(tmp_path), Watching(stop_at(event, 1)))
    counting = Counting()
    run_search(tmp_path / "run", small(tmp_path, budget={"generations": 3}), executor=counting)
    if event == "confirming":
        assert counting.fitted["fit-generation1"] == 0
    else:
        assert "fit-generation2" not in counting.fitted
    assert counting.fitted["fit-generation3"] > 0


def test_baselines_that_are_stored_are_not_fitted_again(tmp_path):
    """Each is stored as soon as it is fitted to the last material."""

    def configuration():
        baselines = ["power-iterations", "bivariate", "lambert"]
        materials = ["builtin:metal", "builtin:fabric"]
        return small(tmp_path, materials=materials, baselines=baselines, budget={"minutes": 1e-9})

    with pytest.raises(KeyboardInterrupt):
        # two of lambert, two of power-iterations, and the first of bivariate
        run_search(tmp_path / "run", configuration(), Watching(stop_at("step", 5)))
    assert set(Store.open(tmp_path / "run").baselines()) == {"lambert", "power-iterations"}
    counting, watcher = Counting(), Watching()
    store = run_search(tmp_path / "run", configuration(), watcher, counting)
    assert watcher.stages == [("baselines", 2)]
    assert counting.fitted["judge-baseline"] == 2
    alone = run_search(tmp_path / "alone", configuration())
    assert without_times(front_json(store, configuration())) == without_times(front_json(alone, configuration()))


def test_another_seed_gives_another_front(tmp_path, uninterrupted):
    store = run_search(tmp_path / "run", small(tmp_path, seed=6))
    assert without_times(front_json(store, small(tmp_path))) != uninterrupted[0]


def test_the_best_migrate_in_the_generation_that_is_due(tmp_path):
    """Two islands with and without migrants every second generation: alike until generation 2."""

    def stored_islands(migrants: int, generations: int):
        configuration = small(tmp_path, search={"migrants": migrants}, budget={"generations": generations})
        return run_search(tmp_path / f"run {migrants} {generations}", configuration).islands()

    assert stored_islands(2, 1) == stored_islands(0, 1)
    without, having = stored_islands(0, 2), stored_islands(2, 2)
    for position, island in enumerate(having):
        own, next_ones = without[position].population, without[1 - position].population
        best, worst = sorted(next_ones, key=lambda i: i.rank)[:2], sorted(own, key=lambda i: i.rank)[-2:]
        assert Counter(island.population) == Counter(own) - Counter(worst) + Counter(best)


def test_the_starts_are_judged_as_they_are(tmp_path):
    configuration = small(tmp_path, search={"start": ["phong", "p0 / pi"]}, budget={"generations": 1})
    store = run_search(tmp_path / "run", configuration)
    for start in (parse(PHONG), parse("p0 / pi")):
        error = store.fits()[canonical(start).text][0]
        as_small = [m.screened for m in store.front().members if m.nodes <= start.nodes]
        assert min(as_small) <= error * (1 + SAME)


def test_every_member_of_the_front_is_what_its_genome_makes(tmp_path):
    store = run_search(tmp_path / "run", small(tmp_path))
    for member in store.front().members:
        assert to_text(reify(member.genome)) == member.expression
        assert parse(member.expression).nodes == member.nodes <= 40
        assert len(member.genome.edits) == member.generation
        assert np.isfinite(member.fit.values).all()


def test_the_watcher_hears_of_every_generation_once_it_is_stored(tmp_path):
    heard = []

    def then(event: str) -> None:
        if event.startswith("stored"):
            reader = Store.open(tmp_path / "run")
            heard.append((watcher.standings[-1], reader.totals(), len(reader.front().members)))
            reader.close()

    watcher = Watching(then)
    run_search(tmp_path / "run", small(tmp_path), watcher)
    assert [standing.generation for standing, *_ in heard] == [1, 2, 3, 4]
    for standing, totals, size in heard:
        assert totals == (standing.generation, standing.candidates, standing.fitted)
        assert standing.candidates == 16 * standing.generation
        assert size == len(standing.front.members)
    errors = [standing.front.members[-1].error for standing, *_ in heard]
    assert errors == sorted(errors, reverse=True)


@pytest.mark.parametrize(
    ("budget", "reason", "generations"),
    [
        ({"generations": 2}, "generations", 2),
        ({"candidates": 17}, "candidates", 2),
        ({"minutes": 1e-9}, "minutes", 0),
    ],
)
def test_whichever_budget_is_used_up_first_ends_the_run(tmp_path, budget, reason, generations):
    configuration = small(tmp_path, budget=budget)
    store = Store.create(tmp_path / "run", configuration.text())
    assert Search(plan(configuration), store, LocalExecutor(), Watching()).run() == reason
    assert store.totals()[0] == generations


def test_the_minutes_are_those_of_the_search(tmp_path, monkeypatch):
    """Baselines that take an hour leave the budget of a minute as it is."""
    seconds = 0.0

    def an_hour_passes(event: str) -> None:
        nonlocal seconds
        seconds += 3600.0 * (event == "baselines")

    def monotonic() -> float:
        nonlocal seconds
        seconds += 0.001
        return seconds

    monkeypatch.setattr("gpsearch.search.search.time", SimpleNamespace(monotonic=monotonic))
    configuration = small(tmp_path, budget={"generations": 1, "minutes": 1})
    store = run_search(tmp_path / "run", configuration, Watching(an_hour_passes))
    assert store.totals()[0] == 1
    assert 0 < store.seconds < 60


def test_two_processes_do_not_mix_their_generations(tmp_path):
    """The slower of two searches on one store gives up where the other has gone on."""
    configuration = small(tmp_path, budget={"generations": 3})

    def the_other_goes_on(event: str) -> None:
        if event == "stored 1":
            run_search(tmp_path / "run", small(tmp_path, budget={"generations": 2}))

    with pytest.raises(GpsearchError, match=r"another gpsearch runs here, which is at generation 2"):
        run_search(tmp_path / "run", configuration, Watching(the_other_goes_on))
    store = run_search(tmp_path / "run", configuration)
    alone = run_search(tmp_path / "alone", configuration)
    assert without_times(front_json(store, configuration)) == without_times(front_json(alone, configuration))


def test_formulas_that_are_nowhere_finite_are_survived(tmp_path: Path):
    configuration = small(
        tmp_path,
        search={"start": ["p0 / (wh.z - wh.z)"], "codebank": ["sqrt(0 - 1 - p0)"]},
        budget={"generations": 3},
    )
    store = run_search(tmp_path / "run", configuration)
    assert store.totals()[0] == 3
    assert all(np.isfinite(member.error) for member in store.front().members)
    front_json(store, configuration)


def test_early_stopping_and_warm_starts_are_settings(tmp_path):
    """Off, no fit is given up and no parent helps; on, the history says how many were given up."""
    search = {"islands": 2, "island_size": 32}
    off = {"early_stopping": False, "warm_starts": False}
    store = run_search(tmp_path / "off", small(tmp_path, search=search, fit=off))
    assert all(generation.given_up == 0 for generation in store.generations())
    assert {bar for _, _, bar in store.fits().values()} == {np.inf}
    store = run_search(tmp_path / "on", small(tmp_path, search=search))
    history = store.generations()
    assert history[0].given_up == 0
    assert sum(generation.given_up for generation in history) == sum(
        np.isfinite(bar) for _, _, bar in store.fits().values()
    )
    assert sum(generation.given_up for generation in history) > 0
    for generation in history:
        assert set(generation.stages) == {"breeding", "screening", "confirming", "storing"}
        assert sum(generation.stages.values()) == pytest.approx(generation.seconds, rel=0.2, abs=0.05)


def test_what_computes_the_same_is_fitted_once(tmp_path):
    """Every fit of a run is of a canonical form, and no two of them are the same formula."""
    store = run_search(tmp_path / "run", small(tmp_path))
    for text in store.fits():
        assert canonical(parse(text)).text == text
    assert store.totals()[2] == len(store.seen())
