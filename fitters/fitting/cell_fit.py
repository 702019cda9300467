"""The fit of one expression to every target: a pure function of expression, cells, bounds and settings.

Restarts are seeded from the expression itself, so that the same expression gets the same fit anywhere.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fitters.engine.multistart import Descent
from fitters.engine.prepared import Optima, Prepared
from fitters.errors import FittersError
from fitters.expressions import Expression, to_text
from fitters.fitting.cells import Cells
from fitters.fitting.settings import Bounds, FitSettings
from fitters.grid import Array
from fitters.judging.metrics import Residual

Columns = Mapping[str, NDArray]
"""Parameters over all targets, each (targets,)."""

RANGES = ((1e-2, 5.0), (1e-3, 1e2), (1e-2, 5.0), (1e-300, 1e300))
"""Starts take turns in these ranges, within the bounds: most parameters of published fits lie in the narrowest."""

STEP = 0.5
"""Extent of the first simplex, in logarithms as a rule."""


HOPELESS, POOR = 1.5, 1.05
"""A fit with a bar is given up where its error on the coarse cells is above this multiple of the bar.

HOPELESS after the first descent of every target, POOR after the last. `python -m tests.benchmarks.engine stopping`
counts what that costs: of 1,744 recorded candidates 45 % are given up, 37 of them though they would have met the
bar, and none of the 47 that ever entered a front.
"""


@dataclass(frozen=True, eq=False)
class Fit:
    """The best parameters found. Where no finite fit was found for a target its error is infinite.

    names:          parameters of the expression, `p0`..
    values:         (targets, names)
    errors:         (targets,) by the problem's metric
    error:          of the expression
    evaluations:    of the objective, over all targets
    finished:       False where the fit was given up: the errors are then what it had reached, on few cells
    standard_error: of `error`, for the cells being a sample; 0 where they are all
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    errors: NDArray[np.float64]
    error: float
    evaluations: int
    finished: bool = True
    standard_error: float = 0.0

    @property
    def columns(self) -> dict[str, NDArray[np.float64]]:
        """The parameters over all targets, each (targets,)."""
        return dict(zip(self.names, self.values.T, strict=True))

    def parameters(self, target: int) -> dict[str, float]:
        return dict(zip(self.names, map(float, self.values[target]), strict=True))


def fit_cells(
    expression: Expression,
    cells: Cells,
    metric: Residual,
    bounds: Bounds,
    settings: FitSettings | None = None,
    near: Columns | None = None,
    bar: float = np.inf,
    shift: int = 0,
) -> Fit:
    """The fit of an expression over the cells, by Nelder-Mead over what is not linear in it (genBRDF, 3.6).

    near: parameters, each (targets,), from which every target descends once more: this can only lower the
          error, and the descents without them stay as they are
    bar:  an error; a fit that will not come near it is given up, see `HOPELESS`
    shift: another number has other starts, to measure how much starts matter

    Raises `FittersError` where a parameter of the expression has no bounds. Never raises for a formula that is
    not finite: its error is infinite.
    """
    settings = settings or FitSettings()
    problem = _prepared(expression, cells, bounds)
    starts = _starts(expression, problem.box, settings.starts, shift)
    warm = np.empty((0, problem.searched)) if near is None else problem.coordinates(near)
    limits = (metric.squares(factor * bar, len(cells.weights)) for factor in (HOPELESS, POOR))
    optima = problem.fit(starts, warm, _descent(settings, problem.searched, *limits))
    if not optima.finished:
        return _stated(problem, metric, optima)
    optima = problem.polish(_descent(settings, problem.searched), optima)
    return _sampled(problem, cells, optima, _stated(problem, metric, optima))


def refit_cells(
    expression: Expression,
    cells: Cells,
    metric: Residual,
    bounds: Bounds,
    near: Columns,
    settings: FitSettings,
    *,
    evaluations: int,
) -> Fit:
    """The fit over other cells, all of them as a rule, by one descent from parameters that are there.

    `evaluations` per searched parameter; with 0 only the linear parameters are solved again.
    """
    problem = _prepared(expression, cells, bounds)
    descent = _descent(replace(settings, evaluations=evaluations), problem.searched)
    optima = problem.polish(descent, problem.optima(problem.coordinates(near)))
    return _sampled(problem, cells, optima, _stated(problem, metric, optima))


def _descent(settings: FitSettings, searched: int, hopeless: float = np.inf, poor: float = np.inf) -> Descent:
    limit = settings.evaluations * searched
    return Descent(settings.restarts, settings.rounds, STEP, limit, settings.tolerance, hopeless, poor)


def _prepared(expression: Expression, cells: Cells, bounds: Bounds) -> Prepared:
    missing = [name for name in expression.parameters if name not in bounds]
    if missing:
        raise FittersError(f"no bounds for {', '.join(missing)} of {to_text(expression)}")
    coarse = None if cells.coarse is None else (cells.coarse.weights, cells.coarse.targets)
    return Prepared(expression, cells.features, cells.weights, cells.targets, bounds, coarse, cells.units)


def _stated(problem: Prepared, metric: Residual, optima: Optima) -> Fit:
    """Optima in the expression's own parameters."""
    parameters = problem.parameters(optima)
    values = np.stack(list(parameters.values()), axis=1) if parameters else np.empty((len(optima.value), 0))
    errors = np.sqrt(optima.value)
    return Fit(
        names=tuple(parameters),
        values=np.asarray(values, np.float64),
        errors=errors,
        error=metric.combine(errors),
        evaluations=optima.evaluations,
        finished=optima.finished,
    )


def _sampled(problem: Prepared, cells: Cells, optima: Optima, fitted: Fit) -> Fit:
    """The fit with its standard error, where the cells are a sample."""
    if cells.draws is None or not np.isfinite(fitted.error):
        return fitted
    return replace(fitted, standard_error=_standard_error(problem.squares(optima), cells, fitted.error))


def _standard_error(squares: Array, cells: Cells, error: float) -> float:
    """Of an error whose square is the sum of `squares` (n,) over sampled cells.

    A draw adds its part of the sum. The sample is systematic, so what counts is how much neighbouring draws
    differ, not how much all of them do (Wolter 2007, section 8.2); the root goes by the delta method.
    """
    assert cells.draws is not None
    order = np.argsort(cells.index)
    draws = cells.draws[order]
    parts = np.repeat(squares[order] / draws, draws)
    total, count = float(parts.sum()), len(parts)
    if total == 0.0 or count < 2:
        return 0.0
    variance = 0.5 * count / (count - 1) * float(np.sum(np.diff(parts) ** 2))
    return 0.5 * error * np.sqrt(variance) / total


def _starts(expression: Expression, box: Array, count: int, shift: int = 0) -> Array:
    """Start coordinates (count, d) in a box (2, d): an even sequence, its offset seeded by the expression."""
    low, high = box
    d = len(low)
    if d == 0:
        return np.zeros((1, 0))
    seed = int.from_bytes(hashlib.sha256(to_text(expression).encode()).digest()[:8], "little")
    points = _recurrence(count, d) + np.random.default_rng(seed + shift).random(d)
    points -= np.floor(points)
    for i, (least, largest) in enumerate(RANGES):
        # Coordinates are logarithms where the parameter is bounded away from zero from below.
        first, last = np.maximum(low, np.log(least)), np.minimum(high, np.log(largest))
        narrow = first < last
        first, last = np.where(narrow, first, low), np.where(narrow, last, high)
        points[i :: len(RANGES)] *= last - first
        points[i :: len(RANGES)] += first
    return points


@lru_cache(maxsize=32)
def _recurrence(count: int, d: int) -> Array:
    """Points (count, d) that modulo 1 fill the unit cube evenly: the generalised golden ratio (Roberts 2018)."""
    ratio = 2.0
    for _ in range(40):
        # The root of x^(d + 1) = x + 1.
        ratio = (1.0 + ratio) ** (1.0 / (d + 1))
    return np.outer(np.arange(count), ratio ** -np.arange(1, d + 1))
