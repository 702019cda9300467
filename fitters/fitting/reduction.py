"""How few cells a scene asks for, and what a fit to only these leaves open where the scene does not look."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.expressions import Expression
from fitters.expressions.evaluation import evaluate_features, parameter_free
from fitters.fitting.cell_fit import Fit, fit_cells
from fitters.fitting.cells import Cells, mean_share, sample
from fitters.fitting.polish import polish
from fitters.fitting.problem import Problem, full_cells
from fitters.fitting.settings import Bounds, FitSettings
from fitters.grid import CELLS, above_horizon
from fitters.judging.metrics import RESIDUALS, length
from fitters.materials import Material
from fitters.scenes import LightTable
from fitters.scenes.table import uniform_light

SHARES = (0.99, 0.999, 0.9999)
"""Of the measurement as the scene shows it, in squares, the mean over targets."""


@dataclass(frozen=True)
class CellReduction:
    """How many cells remain at each step, and how few of the last carry most of what is seen.

    grid:     of the half/difference grid
    above:    above the horizon
    measured: in which some material was measured
    lit:      of those, into which the scene's light falls: what a fit is about
    carrying: the fewest lit cells with each of `SHARES`
    sampled:  a search's small sample of the lit cells
    """

    grid: int
    above: int
    measured: int
    lit: int
    carrying: Mapping[float, int]
    sampled: int


def reduction(problem: Problem) -> CellReduction:
    """The reduction of a problem's cells."""
    return CellReduction(
        grid=CELLS,
        above=int(np.count_nonzero(above_horizon())),
        measured=int(np.count_nonzero(_measured(problem.materials))),
        lit=len(problem.full),
        carrying={share: len(carriers(problem.full, share)) for share in SHARES},
        sampled=len(problem.sample),
    )


def carriers(cells: Cells, share: float) -> NDArray[np.int64]:
    """The fewest cells that carry a share of the squared weighted measurement, as positions in rising order."""
    carried = mean_share(cells.targets)
    order = np.argsort(-carried, kind="stable")
    cumulative = np.cumsum(carried[order])
    return np.sort(order[: int(np.searchsorted(cumulative, share * cumulative[-1])) + 1])


@dataclass(frozen=True)
class Price:
    """Errors of one fit by the `light` metric: what a fit to few cells costs on others.

    cells:  that the fit was made on
    scene:  over the cells that the scene lights, as it lights them
    turned: the same under a light turned half round
    beyond: over measured cells that the scene does not light, under the same light from everywhere

    The last two are of as many sampled cells as the problem's fine sample has.
    """

    cells: int
    scene: float
    turned: float
    beyond: float


def prices(
    expression: Expression,
    problem: Problem,
    bounds: Bounds,
    fit: Fit,
    settings: FitSettings,
    turned: LightTable,
) -> dict[str, Price]:
    """Prices of an expression's fits to the cells that carry the first of `SHARES`, to all lit, to all measured.

    fit:    where its fits begin
    turned: the scene's light, turned
    """
    metric, materials, count = RESIDUALS["light"], problem.materials, len(problem.fine)
    few = problem.full.only(carriers(problem.full, SHARES[0]))
    measured = full_cells(Problem(materials, uniform_light()), metric)
    fine = sample(measured, count, 0)
    refitted = fit_cells(expression, fine, metric, bounds, settings.thorough(), near=fit.columns)
    fits = {
        f"{100 * SHARES[0]:g} %": (len(few), polish(expression, few, problem.metric, bounds, fit)),
        "lit": (len(problem.full), polish(expression, problem.full, problem.metric, bounds, fit)),
        "measured": (len(measured), polish(expression, fine, metric, bounds, refitted)),
    }
    over = (
        problem.full if problem.metric is metric else full_cells(problem, metric),
        sample(full_cells(Problem(materials, turned), metric), count, 0),
        sample(measured.only(np.flatnonzero(~np.isin(measured.index, problem.full.index))), count, 0),
    )
    return {
        name: Price(cells, *(_error(expression, one, judged) for judged in over))
        for name, (cells, one) in fits.items()
    }


def _error(expression: Expression, fit: Fit, cells: Cells) -> float:
    """The `light` error over some cells, relative to the measurement on them; 0 where there are none."""
    if not len(cells):
        return 0.0
    constant = parameter_free(expression, cells.features)
    errors = []
    for target, (weights, targets) in enumerate(zip(cells.weights, cells.targets, strict=True)):
        values = evaluate_features(expression, fit.parameters(target), cells.features, constant)
        with np.errstate(all="ignore"):
            errors.append(length(weights * values - targets) / (length(targets) or length(weights) or 1.0))
    error = RESIDUALS["light"].combine(np.array(errors))
    return error if np.isfinite(error) else float("inf")


def _measured(materials: Sequence[Material]) -> NDArray[np.bool_]:
    """Cells (90, 90, 180) in which some material was measured."""
    return np.any([material.valid for material in materials], axis=0)
