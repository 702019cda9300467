"""The wall time of a search, everything included: breeding, lowering, fitting, confirming, storing."""

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fitters.fitting import ProblemRecipe
from gpsearch.run import Generation, WritableStore
from gpsearch.run.lock import RunLock
from gpsearch.search.search import Search, SearchStatus
from tests.benchmarks.runs import Silent, plan
from tests.benchmarks.table import Cell, Table
from workers import DaskSettings, open_executor

LAUNCHER_STAGES = ("breeding", "storing")
"""What islands do one after the other, in the launcher's one process; they wait for their fits side by side."""

PAPER_GENERATIONS = 100


@dataclass(frozen=True)
class Extent:
    """Sizes of the search; the paper's is 4 islands of 1024 over 100 generations."""

    generations: int = 10
    islands: int = 4
    size: int = 1024
    processes: int = 2


class Clock(Silent):
    """Notes for how long a run had searched when all islands had reached a generation, from the first on."""

    def __init__(self) -> None:
        self.seconds: list[float] = []

    def generation(self, status: SearchStatus) -> None:
        # An island may be ahead: the slowest one can bring several generations to their end at once.
        self.seconds += [status.seconds] * (status.generation - len(self.seconds))


def tables(recipe: ProblemRecipe, extent: Extent = Extent()) -> Iterator[Table]:
    """A row per generation, all islands together, and what the paper's whole search would take."""
    planned = plan(
        recipe,
        islands=extent.islands,
        size=extent.size,
        generations=extent.generations,
        early_stopping=True,
    )
    clock = Clock()
    with (
        tempfile.TemporaryDirectory() as folder,
        open_executor(DaskSettings(workers=extent.processes)) as executor,
    ):
        store = WritableStore.create(RunLock(Path(folder) / "run"), "")
        Search(planned, store, executor, clock).run()
        history, total, members = store.generations(), store.seconds, len(store.front().members)
        store.close()
    seconds = np.diff([0.0, *clock.seconds]).tolist()
    rows = tuple(
        _row([one for one in history if one.generation == generation], took)
        for generation, took in enumerate(seconds, start=1)
    )
    yield Table(
        f"{extent.generations} generations of {extent.islands} x {extent.size} on {extent.processes} processes",
        (
            "generation",
            "seconds",
            *LAUNCHER_STAGES,
            "candidates per second",
            "known already",
            "given up",
            "confirmed",
            "best error",
        ),
        rows,
        (
            "seconds: from when the slowest island had reached the generation before; others may be ahead of it.",
            "breeding, storing: seconds in the launcher, over all islands; workers fit meanwhile.",
            f"all generations: {sum(seconds):.0f} s; loading by the workers is in the first.",
            f"{PAPER_GENERATIONS} generations: {_extrapolated(seconds) / 60:.0f} minutes, by a straight line "
            "through those after the second.",
            f"front: {members} members. Up to the last stored generation the run took {total:.0f} s.",
        ),
    )


def _row(islands: Sequence[Generation], seconds: float) -> tuple[Cell, ...]:
    """A generation of all islands."""
    candidates, fitted = sum(one.candidates for one in islands), sum(one.fitted for one in islands)
    return (
        islands[0].generation,
        seconds,
        *(sum(one.stages[stage] for one in islands) for stage in LAUNCHER_STAGES),
        candidates / seconds if seconds else None,
        f"{100 * (1 - fitted / candidates):.1f} %",
        f"{100 * sum(one.given_up for one in islands) / max(fitted, 1):.0f} %",
        sum(one.confirmed for one in islands),
        min(one.best for one in islands),
    )


def _extrapolated(seconds: list[float]) -> float:
    """Seconds of the paper's number of generations, what is not measured by a straight line through what is."""
    measured = len(seconds)
    settled = np.arange(min(2, measured - 1), measured)
    slope, start = np.polyfit(settled, np.array(seconds)[settled], 1) if len(settled) > 1 else (0.0, seconds[-1])
    rest = np.arange(measured, PAPER_GENERATIONS)
    return float(sum(seconds) + np.sum(start + slope * rest))
