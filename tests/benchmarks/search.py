"""The wall time of a search, everything included: breeding, lowering, fitting, confirming, storing."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fitters.fits import ProblemRecipe
from gpsearch.front import Store
from gpsearch.search.search import Search
from tests.benchmarks.runs import Silent, plan
from tests.benchmarks.table import Table
from workers import DaskSettings, open_executor

STAGES = ("breeding", "screening", "confirming", "storing")
PAPER_GENERATIONS = 100


@dataclass(frozen=True)
class Extent:
    """Sizes of the search; the paper's is 4 islands of 1024 over 100 generations."""

    generations: int = 10
    islands: int = 4
    size: int = 1024
    processes: int = 2


def tables(recipe: ProblemRecipe, extent: Extent = Extent()) -> Iterator[Table]:
    """A row per generation, and what the paper's whole search would take."""
    planned = plan(
        recipe,
        islands=extent.islands,
        size=extent.size,
        generations=extent.generations,
        early_stopping=True,
    )
    with (
        tempfile.TemporaryDirectory() as folder,
        open_executor(DaskSettings(workers=extent.processes)) as executor,
    ):
        store = Store.create(Path(folder) / "run", "")
        Search(planned, store, executor, Silent()).run()
        history, total, members = store.generations(), store.seconds, len(store.front().members)
        store.close()
    rows = [
        (
            one.generation,
            one.seconds,
            *(one.stages[stage] for stage in STAGES),
            one.candidates / one.seconds,
            f"{100 * (1 - one.fitted / one.candidates):.1f} %",
            f"{100 * one.given_up / max(one.fitted, 1):.0f} %",
            one.confirmed,
            one.best,
        )
        for one in history
    ]
    seconds = [one.seconds for one in history]
    yield Table(
        f"{extent.generations} generations of {extent.islands} x {extent.size} on {extent.processes} processes",
        (
            "generation",
            "seconds",
            *STAGES,
            "candidates per second",
            "known already",
            "given up",
            "confirmed",
            "best error",
        ),
        tuple(rows),
        (
            f"all generations: {sum(seconds):.0f} s; loading by the workers is in the first.",
            "Workers fit while others are bred.",
            f"{PAPER_GENERATIONS} generations: {_extrapolated(seconds) / 60:.0f} minutes, by a straight line "
            "through those after the second.",
            f"front: {members} members. Up to the last stored generation the run took {total:.0f} s.",
        ),
    )


def _extrapolated(seconds: list[float]) -> float:
    """Seconds of the paper's number of generations, what is not measured by a straight line through what is."""
    measured = len(seconds)
    settled = np.arange(min(2, measured - 1), measured)
    slope, start = np.polyfit(settled, np.array(seconds)[settled], 1) if len(settled) > 1 else (0.0, seconds[-1])
    rest = np.arange(measured, PAPER_GENERATIONS)
    return float(sum(seconds) + np.sum(start + slope * rest))
