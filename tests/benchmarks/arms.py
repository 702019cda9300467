"""The searches that the ablation compares: as it is, with each speed-up off, and as the paper describes it.

What is no key of the configuration is switched off by substituting a function while the search runs.
"""

import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any
from unittest.mock import patch

import numpy as np

from fitters.backends import program
from fitters.engine import prepared
from fitters.engine.prepared import Optima, Prepared
from fitters.expressions import Expression
from fitters.fitting import Confirmed, ConfirmJob, Fit, FitSettings, Problem, cell_fit, refit_cells, stages
from fitters.fitting.cell_fit import _descent, _prepared, _starts, _stated
from fitters.fitting.cells import Cells
from fitters.fitting.settings import Bounds
from fitters.judging.metrics import Residual
from gpsearch.search import island_search
from gpsearch.search.memory import Memory

ALL_CELLS = 10_000_000
"""More than there are."""

PAPER_RESTARTS = 3
"""The paper: "multiple"."""
PAPER_EVALUATIONS = 200
"""Per parameter, of a descent that does not converge before; what fminsearch and SciPy allow."""


@dataclass(frozen=True)
class Arm:
    """A search without something.

    fit:         keys of the configuration's section
    substitutes: (object, attribute, value), in place while the search runs
    """

    name: str
    fit: Mapping[str, Any] = field(default_factory=dict)
    substitutes: tuple[tuple[Any, str, Any], ...] = ()


@lru_cache(maxsize=256)
def lower_without_split(expression: Expression) -> program.Program:
    """The program of an expression of which no parameter is solved in closed form."""
    with patch.object(program, "split_linear", lambda form, root: {None: root}):
        return program.lower.__wrapped__(expression)


def prepare_without_coarse_part(expression: Expression, cells: Cells, bounds: Bounds) -> Prepared:
    """The descents, too, see all cells of a sample, not a quarter."""
    return _prepared(expression, replace(cells, coarse=None), bounds)


def confirm_as_screened(fit_problem: Problem, task: ConfirmJob) -> Confirmed:
    """The screened parameters, judged on all cells."""
    started = time.perf_counter()
    assert task.near is not None
    job, expression = task.job, stages.parse(task.job.expressions[0])
    full, metric = fit_problem.full, fit_problem.metric
    found = refit_cells(expression, full, metric, job.intervals, task.near, job.settings, evaluations=0)
    return Confirmed(found, time.perf_counter() - started)


def fit_as_the_paper(
    expression: Expression,
    cells: Cells,
    metric: Residual,
    bounds: Bounds,
    settings: FitSettings | None = None,
    near: object = None,
    bar: float = np.inf,
) -> Fit:
    """Section 3.6: from random parameters a simplex search over all of them, again and again; the best counts."""
    made = _prepared(expression, cells, bounds)
    single = FitSettings(starts=1, restarts=1, rounds=0, evaluations=PAPER_EVALUATIONS)
    nothing = np.empty((0, made.searched))
    starts = _starts(expression, made.box, PAPER_RESTARTS)
    found = [made.fit(start[None], nothing, _descent(single, made.searched)) for start in starts]
    best = np.argmin([one.value for one in found], axis=0)
    targets = np.arange(len(best))
    x, c, value = (np.stack([getattr(one, key) for one in found])[best, targets] for key in ("x", "c", "value"))
    return _stated(made, metric, Optima(x, c, value, sum(one.evaluations for one in found)))


WITHOUT_PROJECTION = (prepared, "lower", lower_without_split)
WITHOUT_MEMORY = (Memory, "knows", lambda self, key, bar: key in self.new_fits)
"""Known is only what a generation that was broken off has fitted."""
AS_SCREENED = (island_search, "confirm", confirm_as_screened)

ARMS = {
    arm.name: arm
    for arm in (
        Arm("full"),
        Arm("no-early-stopping", {"early_stopping": False}),
        Arm("no-warm-starts", {"warm_starts": False}),
        Arm("no-exchange", {"rounds": 0}),
        Arm("no-coarse-cells", substitutes=((cell_fit, "_prepared", prepare_without_coarse_part),)),
        Arm("no-projection", substitutes=(WITHOUT_PROJECTION,)),
        Arm("no-memory", substitutes=(WITHOUT_MEMORY,)),
        Arm("confirm-as-screened", substitutes=(AS_SCREENED,)),
        Arm("confirm-on-all-cells", {"confirm_cells": ALL_CELLS}),
        Arm("all-cells", {"cells": ALL_CELLS}),
        Arm(
            "paper",
            {"cells": ALL_CELLS, "early_stopping": False, "warm_starts": False},
            (WITHOUT_PROJECTION, WITHOUT_MEMORY, AS_SCREENED, (stages, "fit_cells", fit_as_the_paper)),
        ),
    )
}
"""`full` is a search as it is by default. `paper` is what the paper describes, on this engine: no sample, no
confirmation, no closed form, no memory, nothing given up or inherited."""


@contextmanager
def substituted(arm: Arm) -> Iterator[None]:
    with ExitStack() as stack:
        for place, name, value in arm.substitutes:
            stack.enter_context(patch.object(place, name, value))
        yield
