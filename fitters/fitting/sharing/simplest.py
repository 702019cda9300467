"""As few numbers for a formula as go unnoticed: backward elimination, one parameter a step further at a time.

Each step takes the sharing that raises the error least, of those that go unnoticed. Sharing more never lowers the
least error, so that a parameter which may not go further at one step may not at a later one. The way there is on
sampled cells; what counts in the end is a fit on all of them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fitters.expressions import Expression
from fitters.fitting.cell_fit import Fit
from fitters.fitting.cells import Cells
from fitters.fitting.problem import Problem
from fitters.fitting.settings import Bounds
from fitters.fitting.sharing.sharing import Sharing
from fitters.fitting.sharing.tied import tied_fit
from fitters.grid import CHANNELS
from fitters.judging.metrics import length

FLOOR = 1e-6
"""Errors relative to a material's length that count as none: the measurement is held in float32."""

Unnoticed = Callable[[Fit, Fit], bool]
"""Whether a fit with parameters shared is as good as one with all free, on the same cells."""


@dataclass(frozen=True, eq=False)
class Shared:
    """What is shared and the fit on all cells with that, beside the one in which everything is free."""

    sharing: Sharing
    fit: Fit
    free: Fit


def within(tolerance: float, cells: Cells) -> Unnoticed:
    """That no material's error grows by more than `tolerance`, relative; `FLOOR` more goes unnoticed.

    A material's error is the root of the sum of squares over its channels; any cells of the problem will do.
    """
    lengths = _by_material(np.array([length(row) for row in cells.targets]))

    def unnoticed(tied: Fit, free: Fit) -> bool:
        allowed = (1.0 + tolerance) * _by_material(free.errors) + FLOOR * lengths
        return bool(np.all(_by_material(tied.errors) <= allowed))

    return unnoticed


def _by_material(errors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.sum(errors.reshape(-1, len(CHANNELS)) ** 2, axis=1))


def share(expression: Expression, problem: Problem, bounds: Bounds, free: Fit, unnoticed: Unnoticed) -> Shared:
    """The sharing that goes unnoticed on all cells where no parameter may go a step further.

    `free` is a fit of every target by itself, such as `describe` leaves.
    """
    nothing = Sharing.nothing(free.names)

    def tied(cells: Cells, sharing: Sharing, near: Fit) -> Fit:
        return tied_fit(expression, cells, problem.metric, bounds, sharing, near)

    path = _eliminated(
        lambda sharing, near: tied(problem.sample, sharing, near),
        tied(problem.sample, nothing, free),
        len(problem.names),
        unnoticed,
    )
    judges = [(cells, tied(cells, nothing, free)) for cells in (problem.fine, problem.full)]
    for sharing, fit in reversed(path):
        for cells, reference in judges:
            fit = tied(cells, sharing, fit)
            if not unnoticed(fit, reference):
                break
        else:
            return Shared(sharing, fit, judges[-1][1])
    return Shared(nothing, judges[-1][1], judges[-1][1])


def _eliminated(
    tied: Callable[[Sharing, Fit], Fit], free: Fit, materials: int, unnoticed: Unnoticed
) -> list[tuple[Sharing, Fit]]:
    """The sharings on the way, each a step further than the last, with their fits on the sample."""
    sharing, fit = Sharing.nothing(free.names), free
    path: list[tuple[Sharing, Fit]] = []
    refused: set[str] = set()
    while True:
        further = {
            name: (tightened, tied(tightened, fit))
            for name, tightened in sharing.tightened(materials).items()
            if name not in refused
        }
        for name, (candidate, candidate_fit) in sorted(further.items(), key=lambda item: item[1][1].error):
            if unnoticed(candidate_fit, free):
                sharing, fit = candidate, candidate_fit
                path.append((sharing, fit))
                break
            refused.add(name)
        else:
            return path
