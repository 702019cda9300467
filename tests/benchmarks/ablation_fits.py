"""What each speed-up of a fit buys and costs: the same candidates of a search, fitted with each switched off.

What a search of a minute finds is half luck. This is not, and it leaves the confirmations out.
"""

import math
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fitters.backends import program
from fitters.expressions import parse
from fitters.fitting import Candidate, Problem, refit_cells
from gpsearch.configuration import Configuration
from gpsearch.run import WritableStore
from gpsearch.run.lock import RunLock
from gpsearch.search.plan import Plan, plan
from tests.benchmarks.arms import ARMS, lower_without_split, substituted
from tests.benchmarks.runs import Silent
from tests.benchmarks.stopping import RecordedSearch
from tests.benchmarks.table import Cell, Table
from workers.context import context_of
from workers.local import LocalExecutor

SAME_FITS = ("no-memory", "confirm-as-screened", "confirm-on-all-cells")
"""Arms that fit a candidate as `full` does."""

WORSE = 1.01
"""A fit counts as worse where its error is more than so many times that of `full`."""


@dataclass(frozen=True)
class Extent:
    """How many candidates are fitted in every way; on all cells, which takes seconds, so many of them."""

    sampled: int = 150
    all_cells: int = 6


@dataclass(frozen=True)
class Measured:
    """Seconds of a core, and the error on the fine sample; infinite where the fit was given up."""

    seconds: float
    error: float


def table(configurations: dict[str, Configuration], extent: Extent = Extent()) -> Table:
    """A row per arm that fits differently; `configurations` by its name."""
    plans = {name: plan(one) for name, one in configurations.items() if name not in SAME_FITS}
    problems = {name: context_of(one.recipe) for name, one in plans.items()}
    every = _recorded(plans["full"])
    chosen = [every[i] for i in np.linspace(0, len(every) - 1, extent.sampled).astype(int)]
    few = set(np.linspace(0, len(chosen) - 1, extent.all_cells).astype(int))
    found: dict[str, dict[int, Measured]] = {name: {} for name in plans}
    for i, candidate in enumerate(chosen):
        for name, one in plans.items():
            if i in few or problems[name].sample is not problems[name].full:
                found[name][i] = _measured(name, problems[name], one, candidate)
    return Table(
        f"{len(chosen)} candidates of a search, fitted in every way",
        ("search", "candidates", "ms, mean", "times full's", "given up", "worse", "better"),
        tuple((name, *_row(measured, found["full"])) for name, measured in found.items()),
        (
            f"candidates: on all cells {extent.all_cells} of them; ratios are to `full` on the same ones.",
            f"worse, better: error more than {100 * (WORSE - 1):.0f} % above that of `full`, or as much below, of"
            " those that both have carried through, on the fine sample.",
        ),
    )


def _recorded(planned: Plan) -> list[Candidate]:
    """What a search screens after its first generation, with the bar and the warm start of each."""
    with tempfile.TemporaryDirectory() as folder:
        store = WritableStore.create(RunLock(Path(folder) / "run"), "")
        search = RecordedSearch(planned, store, LocalExecutor(), Silent())
        search._search()
        store.close()
    return [candidate for candidate in search.recorded if math.isfinite(candidate.bar)]


def _measured(name: str, problem: Problem, planned: Plan, candidate: Candidate) -> Measured:
    bar = candidate.bar if planned.early_stopping else math.inf
    near = candidate.near if planned.warm_starts else None
    # What one arm has lowered would be there for the next.
    program.lower.cache_clear()
    lower_without_split.cache_clear()
    with substituted(ARMS[name]):
        began = time.process_time()
        fitted = planned.screen(problem, replace(candidate, bar=bar, near=near))
        seconds = time.process_time() - began
        if not fitted.finished or not np.isfinite(fitted.error):
            return Measured(seconds, math.inf)
        bounds = {name: (low, high) for name, low, high in planned.bounds}
        expression = parse(candidate.expression)
        judged = refit_cells(
            expression, problem.fine, problem.metric, bounds, fitted.columns, planned.settings, evaluations=0
        )
    return Measured(seconds, judged.error)


def _row(measured: dict[int, Measured], full: dict[int, Measured]) -> tuple[Cell, ...]:
    seconds = sum(one.seconds for one in measured.values())
    both = [
        one.error / full[i].error
        for i, one in measured.items()
        if math.isfinite(one.error) and math.isfinite(full[i].error) and full[i].error > 0
    ]
    given_up = sum(math.isinf(one.error) for one in measured.values())
    return (
        len(measured),
        1e3 * seconds / len(measured),
        seconds / sum(full[i].seconds for i in measured),
        f"{100 * given_up / len(measured):.0f} %",
        f"{100 * sum(r > WORSE for r in both) / max(len(both), 1):.0f} %",
        f"{100 * sum(r < 1 / WORSE for r in both) / max(len(both), 1):.0f} %",
    )
