"""Candidates that crash, hang or raise cost a run themselves alone."""

import os
import signal
import time
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from fitters.expressions import parse
from fitters.fitting import Candidate, Fit, Problem, screen
from gpsearch.run import Known, Store, result_of
from gpsearch.search.plan import Plan, plan
from gpsearch.search.search import Search
from tests.gpsearch.small import Watching, make_store, run_search, small, without_times, writing
from workers import DaskSettings, Done, Executor, Failure, WorkersError, open_executor
from workers.local import LocalExecutor

TARGETS = 3


def bad_screen(problem: Problem, candidate: Candidate, *, victims: dict[str, str], **settings) -> Fit:
    """As `screen`, but for the victims, each of which fails in its way."""
    match victims.get(candidate.expression):
        case "crash":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hang":
            time.sleep(3600)
        case "raise":
            raise ZeroDivisionError("never seen before")
        case "nothing":
            count = len(parse(candidate.expression).parameters)
            names = tuple(f"p{i}" for i in range(count))
            return Fit(names, np.ones((TARGETS, count)), np.full(TARGETS, np.inf), np.inf, 0)
    return screen(problem, candidate, **settings)


@dataclass(frozen=True)
class BadPlan(Plan):
    """A plan some of whose candidates fail."""

    victims: tuple[tuple[str, str], ...] = ()

    @property
    def screen(self):
        return partial(bad_screen, victims=dict(self.victims), bounds=self.bounds, settings=self.settings)


def searched(folder: Path, victims: dict[str, str], executor: Executor, size: int = 8) -> Store:
    changes = {"budget": {"generations": 2}, "baselines": []}
    configuration = small(folder, fit={"warm_starts": False}, search={"island_size": size}, **changes)
    planned = BadPlan(**vars(plan(configuration)), victims=tuple(victims.items()))
    with writing(make_store(folder / "run", configuration.text())) as store:
        Search(planned, store, executor, Watching()).run()
    return Store.open(folder / "run")


@pytest.fixture(scope="module")
def expressions(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """What a run fits in its second generation, so that it is in the midst of something."""
    store = searched(tmp_path_factory.mktemp("expressions"), {}, LocalExecutor())
    return sorted(key for key, known in store.fits() if known.generation == 2)


@pytest.mark.long
def test_a_run_survives_what_crashes_hangs_and_raises(tmp_path, expressions):
    """Its front is the one of a run in which the same candidates have no fit."""
    ways = dict(zip(expressions[::3], ["crash", "hang", "raise"], strict=False))
    assert len(ways) == 3
    (tmp_path / "alone").mkdir()
    unfitted = searched(tmp_path / "alone", dict.fromkeys(ways, "nothing"), LocalExecutor())
    (tmp_path / "bad").mkdir()
    with open_executor(DaskSettings(workers=2, hang_seconds=1)) as executor:
        survived = searched(tmp_path / "bad", ways, executor)
        incidents = executor.incidents()
    assert incidents == []
    configuration = small(tmp_path)
    fronts = [without_times(result_of(store, configuration).to_json()) for store in (unfitted, survived)]
    assert fronts[0] == fronts[1]
    assert unfitted.quarantined() == []
    found = {one.reason.split(",")[0]: one for one in survived.quarantined()}
    assert len(found) == 3
    for reason in (
        "its worker process died",
        "did not end within 1 s",
        "raised ZeroDivisionError: never seen before",
    ):
        assert found[reason].stage == "screen"
        assert found[reason].generation == 2
    known = dict(survived.fits())
    assert all(known[expression] == Known(np.inf, 0.0, np.inf, known[expression].island, 2) for expression in ways)


def test_where_nearly_all_fail_the_run_does(tmp_path):
    """Not the candidates are to blame then. What was stored before is kept."""
    (tmp_path / "well").mkdir()
    well = searched(tmp_path / "well", {}, LocalExecutor(), size=32)
    later = [key for key, known in well.fits() if known.generation == 2]
    (tmp_path / "bad").mkdir()
    with pytest.raises(WorkersError, match=r"screen island \d generation 2: \d+ of \d+ candidates could not be"):
        searched(tmp_path / "bad", dict.fromkeys(later, "raise"), LocalExecutor(), size=32)
    store = Store.open(tmp_path / "bad" / "run")
    assert set(store.island_generations().values()) == {1}
    assert store.totals()[1] == 64


class Sick(LocalExecutor):
    """Whatever work begins with a word fails, after some of it went well."""

    def __init__(self, word: str, well: int = 0) -> None:
        super().__init__()
        self.word, self.well = word, well

    def wait(self, seconds):
        (done,) = super().wait(seconds)
        if done.job.label.startswith(self.word):
            self.well -= 1
            if self.well < 0:
                return [Done(done.job, done.index, Failure("raised OSError: stale file handle"))]
        return [done]


SICK = {"search": {"island_size": 32}, "budget": {"generations": 2}}


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Store:
    folder = tmp_path_factory.mktemp("healthy")
    return run_search(folder / "run", small(folder, **SICK))


@pytest.mark.parametrize(
    ("word", "well", "kind"),
    [
        ("screen", 40, WorkersError),
        # A generation of this search confirms half a dozen: only where all of them fail is none to blame.
        pytest.param("confirm", 0, WorkersError, marks=pytest.mark.long),
        ("describe front", 1, None),
        pytest.param("lambert", 0, None, marks=pytest.mark.long),
    ],
)
def test_a_machine_that_is_sick_for_a_while_changes_nothing(healthy, tmp_path, word, well, kind):
    """Failures of all that is tried end a run, or leave something out; once mended, the same front is found."""
    configuration = small(tmp_path, **SICK)
    with pytest.raises(kind) if kind else nullcontext():
        run_search(tmp_path / "run", configuration, executor=Sick(word, well))
    sick = Store.open(tmp_path / "run")
    assert kind or {one.stage for one in sick.quarantined()} <= {"describe", "baseline"}
    mended = run_search(tmp_path / "run", configuration)
    fronts = [without_times(result_of(store, configuration).to_json()) for store in (healthy, mended)]
    assert fronts[0] == fronts[1]
    assert mended.islands() == healthy.islands()
