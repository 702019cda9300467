"""Searches whose fits are replaced by sleeps of recorded durations: all but the fits is real.

What a simulated fit takes and finds depends on its canonical expression alone, as with a real one.
"""

import hashlib
import json
import re
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from fitters.expressions import parse
from fitters.expressions.canonical import canonical
from fitters.fitting import Candidate, Confirmed, ConfirmJob, Fit, FitSettings
from fitters.fitting.cell_fit import POOR
from fitters.grid import CHANNELS
from gpsearch.run import WritableStore
from gpsearch.run.lock import RunLock
from gpsearch.search import island_search
from gpsearch.search.plan import Plan
from tests.benchmarks.metering import UndescribedSearch
from tests.benchmarks.runs import Silent
from workers import Done, Recipe
from workers.context import context_of
from workers.local import LocalExecutor

SPREAD = 0.02
"""Relative, of what errors are drawn by: those of two expressions that are the same count as one function's."""

WARM_UP = 10
"""Screenings that are not recorded: the first ones may compile."""

_PARAMETER = re.compile(r"\bp\d+\b")


@dataclass(frozen=True)
class Recording:
    """What fits of a real search took, in seconds of a core, and what they found.

    carried_through, given_up: seconds of screenings
    confirmed:                 seconds of fits on more cells
    errors, standard_errors:   of screened candidates, in the same order
    targets:                   of the problem
    """

    carried_through: Sequence[float]
    given_up: Sequence[float]
    confirmed: Sequence[float]
    errors: Sequence[float]
    standard_errors: Sequence[float]
    targets: int

    def error(self, form: str) -> tuple[float, float]:
        """The error of a canonical expression, and its standard error."""
        which = int(share(form, "error") * len(self.errors))
        spread = 1 + SPREAD * (share(form, "spread") - 0.5)
        return spread * self.errors[which], self.standard_errors[which]

    def seconds(self, form: str, kind: str) -> float:
        """What a canonical expression takes: `carried_through`, `given_up` or `confirmed`."""
        durations = getattr(self, kind) or self.carried_through
        return durations[int(share(form, kind) * len(durations))]

    def slept(self, done: Done) -> float:
        """What a simulated fit took, if its worker was in time."""
        if isinstance(done.result, Confirmed):
            return done.result.seconds
        kind = "carried_through" if done.result.finished else "given_up"
        return self.seconds(done.job.items[done.index].expression, kind)


def share(form: str, what: str) -> float:
    """A number in [0, 1), another one for everything that is drawn for an expression."""
    digest = hashlib.blake2b(f"{what} {form}".encode(), digest_size=6).digest()
    return int.from_bytes(digest, "little") / 2**48


# recording


def record(planned: Plan) -> Recording:
    """What the fits of a search take in this process, one after the other."""
    context_of(planned.recipe)
    executor = _TimingExecutor()
    with tempfile.TemporaryDirectory() as folder:
        store = WritableStore.create(RunLock(Path(folder) / "run"), "")
        UndescribedSearch(planned, store, executor, Silent()).run()
        store.close()
    screened = [(seconds, done.result) for seconds, done in executor.timed if done.job.kind == "screen"]
    fits = [(seconds, fit) for seconds, fit in screened[WARM_UP:] or screened if isinstance(fit, Fit)]
    return Recording(
        carried_through=[seconds for seconds, fit in fits if fit.finished],
        given_up=[seconds for seconds, fit in fits if not fit.finished],
        confirmed=[seconds for seconds, done in executor.timed if done.job.kind == "confirm"],
        errors=[fit.error for _, fit in fits],
        standard_errors=[fit.standard_error for _, fit in fits],
        targets=len(CHANNELS) * planned.materials,
    )


class _TimingExecutor(LocalExecutor):
    """Notes what every item takes."""

    def __init__(self) -> None:
        super().__init__()
        self.timed: list[tuple[float, Done]] = []

    def wait(self, seconds: float) -> list[Done]:
        # Of the processor, as what others do on this machine is no part of it.
        began = time.thread_time()
        found = super().wait(seconds)
        took = time.thread_time() - began
        self.timed += ((took, done) for done in found)
        return found


def save(recording: Recording, path: Path) -> Recipe:
    """The recipe by which any process of this machine loads the recording."""
    path.write_text(json.dumps(vars(recording)))
    return Recipe(load, str(path))


def load(path: str) -> Recording:
    return Recording(**json.loads(Path(path).read_text()))


# fits


def screen(
    recording: Recording,
    candidate: Candidate,
    *,
    bounds: tuple[tuple[str, float, float], ...],
    settings: FitSettings,
) -> Fit:
    """In place of `fitters.fitting.screen`."""
    form = candidate.expression
    error, standard_error = recording.error(form)
    finished = error <= POOR * candidate.bar
    seconds = recording.seconds(form, "carried_through" if finished else "given_up")
    time.sleep(seconds)
    return _fit(recording, form, error, standard_error, finished)


def confirm(recording: Recording, task: ConfirmJob) -> Confirmed:
    """In place of `fitters.fitting.confirm`."""
    (text,) = task.job.expressions
    form = canonical(parse(text)).text
    error, standard_error = recording.error(form)
    seconds = recording.seconds(form, "confirmed")
    time.sleep(seconds)
    return Confirmed(_fit(recording, text, error, standard_error, True), seconds)


def _fit(recording: Recording, text: str, error: float, standard_error: float, finished: bool) -> Fit:
    names = tuple(sorted(set(_PARAMETER.findall(text))))
    return Fit(
        names=names,
        values=np.ones((recording.targets, len(names))),
        errors=np.full(recording.targets, error),
        error=error,
        evaluations=0,
        finished=finished,
        standard_error=standard_error,
    )


@dataclass(frozen=True)
class SimulatedPlan(Plan):
    """A plan whose candidates are not fitted."""

    @property
    def screen(self) -> Callable[[Any, Candidate], Fit]:
        return partial(screen, bounds=self.bounds, settings=self.settings)

    @classmethod
    def of(cls, planned: Plan, recipe: Recipe) -> "SimulatedPlan":
        return cls(**{f.name: getattr(planned, f.name) for f in fields(planned)} | {"recipe": recipe})


@contextmanager
def simulated() -> Iterator[None]:
    """Within it, no search of this process fits what it confirms."""
    with patch.object(island_search, "confirm", confirm):
        yield
