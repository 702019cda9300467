"""The search as a whole: what it tells, what it stores, and that stopping changes nothing."""

import fcntl
import math
import random
from collections import Counter, deque
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fitters.expressions import parse, to_text
from fitters.expressions.canonical import canonical
from fitters.expressions.catalogue import CATALOGUE
from gpsearch.errors import GpsearchError
from gpsearch.genomes import reify
from gpsearch.run import Store, result_of
from gpsearch.run.front import SAME
from gpsearch.search.plan import plan
from gpsearch.search.search import Search
from tests.gpsearch.small import Watching, make_store, run_search, small, without_times, writing
from workers.local import LocalExecutor

PHONG = to_text(CATALOGUE["phong"].expression)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, tuple[int, int, int], int]:
    """The front of a run never stopped, its totals, and how many steps of work it took."""
    folder = tmp_path_factory.mktemp("uninterrupted")
    watcher = Watching()
    store = run_search(folder / "run", small(folder), watcher)
    return without_times(result_of(store, small(folder)).to_json()), store.totals(), watcher.steps


def stop_at(event: str, count: int) -> Callable[[str], None]:
    """Something to call with events that is interrupted, as by Ctrl-C, at the count-th of a name."""
    left = count

    def then(happened: str) -> None:
        nonlocal left
        left -= happened == event
        if not left and happened == event:
            raise KeyboardInterrupt

    return then


SEEDS = [0, pytest.param(1, marks=pytest.mark.long), pytest.param(2, marks=pytest.mark.long)]


@pytest.mark.parametrize(
    ("event", "count"),
    [
        ("baselines", 1),
        ("searching", 1),
        ("step", 4),
        ("stored 1", 1),
        pytest.param("step", 12, marks=pytest.mark.long),
        pytest.param("stored 2", 1, marks=pytest.mark.long),
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
    assert without_times(result_of(store, small(tmp_path)).to_json()) == exported
    assert store.totals() == totals
    assert before.steps + after.steps >= steps


class Unordered(LocalExecutor):
    """Computes what waits in a random order, so that islands lose step, and is interrupted after some results."""

    def __init__(self, seed: int, results: float = math.inf) -> None:
        super().__init__()
        self.random, self.left = random.Random(seed), results

    def wait(self, seconds):
        if self.left <= 0:
            raise KeyboardInterrupt
        self.left -= 1
        # Rather of one job than of others, so that its island runs ahead.
        self._waiting = deque(sorted(self._waiting, key=lambda waiting: waiting[0].label, reverse=True))
        self._waiting.rotate(-self.random.choice([0, 0, 0, self.random.randrange(len(self._waiting))]))
        return super().wait(seconds)


@pytest.fixture(scope="module")
def in_order(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The front of a run of three islands, one after the other."""
    folder = tmp_path_factory.mktemp("in_order")
    return without_times(result_of(run_search(folder / "run", three(folder)), three(folder)).to_json())


def three(folder: Path):
    """Three islands that meet after every third generation."""
    search = {"islands": 3, "island_size": 8, "migrate_every": 3}
    return small(folder, search=search, budget={"generations": 8})


@pytest.mark.parametrize("seed", SEEDS)
def test_islands_that_lose_step_give_the_same_front(tmp_path, in_order, seed):
    watcher = Watching()
    store = run_search(tmp_path / "run", three(tmp_path), watcher, Unordered(seed))
    assert without_times(result_of(store, three(tmp_path)).to_json()) == in_order


@pytest.mark.parametrize("seed", SEEDS)
def test_islands_out_of_step_may_be_stopped_again_and_again(tmp_path, in_order, seed):
    """Every session ends after some results: between screening and confirming, before and after a migration."""
    numbers, sessions = random.Random(seed), 0
    while True:
        sessions += 1
        try:
            executor = Unordered(numbers.randrange(1000), results=numbers.randrange(10, 50))
            store = run_search(tmp_path / "run", three(tmp_path), executor=executor)
            break
        except KeyboardInterrupt:
            assert sessions < 50
    assert sessions > 3
    assert without_times(result_of(store, three(tmp_path)).to_json()) == in_order


def test_no_island_waits_for_another_but_for_migration(tmp_path):
    """While one item of the first island does not come back, the other one goes on to the migration."""

    class Stuck(LocalExecutor):
        def wait(self, seconds):
            free = [waiting for waiting in self._waiting if "island 0" not in waiting[0].label]
            if not free and any("screen" in job.label for job, _ in self._waiting):
                raise KeyboardInterrupt
            if free:
                self._waiting.remove(free[0])
                self._waiting.appendleft(free[0])
            return super().wait(seconds)

    configuration = small(tmp_path, search={"migrate_every": 3}, budget={"generations": 6})
    with pytest.raises(KeyboardInterrupt):
        run_search(tmp_path / "run", configuration, executor=Stuck())
    store = Store.open(tmp_path / "run")
    assert [(row.island, row.generation) for row in store.generations()] == [(1, 1), (1, 2), (1, 3)]


def test_a_run_that_is_stopped_at_every_generation_gives_the_same_front(tmp_path, uninterrupted):
    for generation in range(1, 5):
        with pytest.raises(KeyboardInterrupt):
            run_search(tmp_path / "run", small(tmp_path), Watching(stop_at(f"stored {generation}", 1)))
    store = run_search(tmp_path / "run", small(tmp_path))
    assert without_times(result_of(store, small(tmp_path)).to_json()) == uninterrupted[0]
    assert store.totals() == uninterrupted[1]


def test_a_larger_budget_goes_on_as_if_it_had_been_given_at_once(tmp_path, uninterrupted):
    run_search(tmp_path / "run", small(tmp_path, budget={"generations": 2}))
    store = run_search(tmp_path / "run", small(tmp_path))
    assert without_times(result_of(store, small(tmp_path)).to_json()) == uninterrupted[0]


class Counting(LocalExecutor):
    """An executor that counts what it computes, by label."""

    def __init__(self) -> None:
        super().__init__()
        self.fitted: Counter[str] = Counter()

    def wait(self, seconds):
        done = super().wait(seconds)
        self.fitted.update(one.job.label for one in done)
        return done


def test_nothing_that_was_fitted_is_fitted_again(tmp_path, uninterrupted):
    """What a generation had screened when it was broken off is known to the next session."""
    alone, before, after = Counting(), Unordered(1, results=30), Counting()
    run_search(tmp_path / "alone", small(tmp_path), executor=alone)
    with pytest.raises(KeyboardInterrupt):
        run_search(tmp_path / "run", small(tmp_path), executor=before)
    run_search(tmp_path / "run", small(tmp_path), executor=after)

    def screened(counting: Counting) -> int:
        return sum(count for label, count in counting.fitted.items() if label.startswith("screen"))

    stored = Store.open(tmp_path / "run")
    assert screened(after) < screened(alone) - 15
    assert sum(1 for _ in stored.fits()) == sum(1 for _ in Store.open(tmp_path / "alone").fits())


def test_baselines_that_are_stored_are_not_fitted_again(tmp_path):
    """Each is stored as soon as it is fitted to the last material."""

    def configuration():
        baselines = ["power-iterations", "bivariate", "lambert"]
        materials = ["builtin:metal", "builtin:fabric"]
        return small(tmp_path, materials=materials, baselines=baselines, budget={"minutes": 1e-9})

    with pytest.raises(KeyboardInterrupt):
        # The first step of lambert, two of power-iterations and two of bivariate, before these are stored.
        run_search(tmp_path / "run", configuration(), Watching(stop_at("step", 5)))
    assert set(Store.open(tmp_path / "run").baselines()) == {"power-iterations"}
    counting, watcher = Counting(), Watching()
    store = run_search(tmp_path / "run", configuration(), watcher, counting)
    assert watcher.stages[0] == ("baselines", 4)
    assert counting.fitted["power-iterations baseline"] == 0
    assert counting.fitted["bivariate baseline"] == 2
    alone = run_search(tmp_path / "alone", configuration())
    assert without_times(result_of(store, configuration()).to_json()) == without_times(
        result_of(alone, configuration()).to_json()
    )


def test_another_seed_gives_another_front(tmp_path, uninterrupted):
    store = run_search(tmp_path / "run", small(tmp_path, seed=6))
    assert without_times(result_of(store, small(tmp_path)).to_json()) != uninterrupted[0]


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
        error = dict(store.fits())[canonical(start).text].error
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
            heard.append((watcher.statuses[-1], reader.totals(), len(reader.front().members)))
            reader.close()

    watcher = Watching(then)
    run_search(tmp_path / "run", small(tmp_path), watcher)
    assert [status.generation for status, *_ in heard] == [1, 2, 3, 4]
    for status, totals, size in heard:
        assert totals == (status.generation, status.candidates, status.fitted)
        assert status.candidates == 16 * status.generation
        assert size == len(status.front.members)
    errors = [status.front.members[-1].error for status, *_ in heard]
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
    with writing(make_store(tmp_path / "run", configuration.text())) as store:
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


def test_no_task_is_begun_after_the_minutes_are_over(tmp_path, monkeypatch):
    """What was fitted until then is kept for a larger budget."""
    seconds, counting = 0.0, Counting()

    def tenth_step(event: str) -> None:
        nonlocal seconds
        if event == "step" and watcher.steps == 2 + 10:
            seconds = 61.0

    watcher = Watching(tenth_step)
    monkeypatch.setattr("gpsearch.search.search.time", SimpleNamespace(monotonic=lambda: seconds))
    configuration = small(tmp_path, budget={"generations": 9, "minutes": 1})
    store = run_search(tmp_path / "run", configuration, watcher, counting)
    screened = sum(count for label, count in counting.fitted.items() if label.startswith("screen"))
    assert screened == 10 == sum(1 for _ in store.fits())
    assert set(store.island_generations().values()) == {0}


def test_two_processes_do_not_mix_their_generations(tmp_path, monkeypatch):
    """Where a file system's locks do nothing, the slower of two searches gives up where the other has gone on."""
    monkeypatch.setattr(fcntl, "flock", lambda descriptor, operation: None)
    configuration = small(tmp_path, budget={"generations": 3})

    def the_other_goes_on(event: str) -> None:
        if event == "stored 1":
            run_search(tmp_path / "run", small(tmp_path, budget={"generations": 2}))

    with pytest.raises(GpsearchError, match="another gpsearch has gone on with this run"):
        run_search(tmp_path / "run", configuration, Watching(the_other_goes_on))
    store = run_search(tmp_path / "run", configuration)
    alone = run_search(tmp_path / "alone", configuration)
    assert without_times(result_of(store, configuration).to_json()) == without_times(
        result_of(alone, configuration).to_json()
    )


def test_formulas_that_are_nowhere_finite_are_survived(tmp_path: Path):
    configuration = small(
        tmp_path,
        search={"start": ["p0 / (wh.z - wh.z)"], "codebank": ["sqrt(0 - 1 - p0)"]},
        budget={"generations": 3},
    )
    store = run_search(tmp_path / "run", configuration)
    assert store.totals()[0] == 3
    assert all(np.isfinite(member.error) for member in store.front().members)
    result_of(store, configuration).to_json()


def test_early_stopping_and_warm_starts_are_settings(tmp_path):
    """Off, no fit is given up and no parent helps; on, the history says how many were given up."""
    search = {"islands": 2, "island_size": 32}
    off = {"early_stopping": False, "warm_starts": False}
    store = run_search(tmp_path / "off", small(tmp_path, search=search, fit=off))
    assert all(generation.given_up == 0 for generation in store.generations())
    assert {fit.bar for _, fit in store.fits()} == {np.inf}
    store = run_search(tmp_path / "on", small(tmp_path, search=search))
    history = store.generations()
    assert all(row.given_up == 0 for row in history if row.generation == 1)
    assert sum(row.given_up for row in history) >= sum(np.isfinite(fit.bar) for _, fit in store.fits()) / 2
    assert sum(generation.given_up for generation in history) > 0
    for generation in history:
        assert set(generation.stages) == {"breeding", "screening", "confirming", "storing"}
        assert sum(generation.stages.values()) == pytest.approx(generation.seconds, rel=0.2, abs=0.05)


def test_what_computes_the_same_is_fitted_once(tmp_path):
    """Every fit of a run is of a canonical form, and no two of them are the same formula."""
    store = run_search(tmp_path / "run", small(tmp_path))
    fits = [(key, fit) for key, fit in store.fits()]
    for text, _ in fits:
        assert canonical(parse(text)).text == text
    # Two islands may find the same between two migrations; the start itself is fitted, but was not bred.
    start = canonical(CATALOGUE["phong"].expression).text
    assert store.totals()[2] == len({(key, fit.island) for key, fit in fits} - {(start, 0)})
