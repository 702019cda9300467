"""The fit of one expression to every target: a pure function of expression, cells, bounds and settings.

Restarts are seeded from the expression itself, so that the same expression gets the same fit anywhere.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fitters.engine.prepared import Prepared
from fitters.engine.multistart import Descent
from fitters.errors import FittersError
from fitters.expressions import Expression, to_text
from fitters.fits.metrics import Metric
from fitters.fits.problem import Cells
from fitters.grid import Array

Bounds = Mapping[str, tuple[float, float]]
"""Closed interval per parameter, `p0`..; a positive lower bound makes a simplex search its logarithm."""

RANGES = ((1e-2, 5.0), (1e-3, 1e2), (1e-2, 5.0), (1e-300, 1e300))
"""Starts take turns in these ranges, within the bounds: most parameters of published fits lie in the narrowest."""

STEP = 0.5
"""Extent of the first simplex, in logarithms as a rule."""


@dataclass(frozen=True)
class FitSettings:
    """How hard a fit tries.

    starts:      points at which every target is tried once
    restarts:    simplex descents per target
    rounds:      of further descents, each from the optimum of another target
    evaluations: per descent and searched parameter
    tolerance:   relative spread of the objective over a converged simplex
    """

    starts: int = 48
    restarts: int = 2
    rounds: int = 1
    evaluations: int = 30
    tolerance: float = 1e-4

    def thorough(self) -> "FitSettings":
        """The settings for the few expressions whose fit is kept: about four times the work."""
        return FitSettings(
            starts=2 * self.starts,
            restarts=2 * self.restarts,
            rounds=self.rounds + 2,
            evaluations=2 * self.evaluations,
            tolerance=0.1 * self.tolerance,
        )

    def descent(self, searched: int) -> Descent:
        limit = self.evaluations * searched
        return Descent(self.restarts, self.rounds, STEP, limit, self.tolerance)


@dataclass(frozen=True, eq=False)
class Fit:
    """The best parameters found. Where no finite fit was found for a target its error is infinite.

    names:       parameters of the expression, `p0`..
    values:      (targets, names)
    errors:      (targets,) by the problem's metric
    error:       of the expression
    evaluations: of the objective, over all targets
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    errors: NDArray[np.float64]
    error: float
    evaluations: int

    @property
    def columns(self) -> dict[str, NDArray[np.float64]]:
        """The parameters over all targets, each (targets,)."""
        return dict(zip(self.names, self.values.T, strict=True))

    def parameters(self, target: int) -> dict[str, float]:
        return dict(zip(self.names, map(float, self.values[target]), strict=True))


def fit(
    expression: Expression,
    cells: Cells,
    metric: Metric,
    bounds: Bounds,
    settings: FitSettings | None = None,
    near: Fit | None = None,
) -> Fit:
    """The fit of an expression over the cells, by Nelder-Mead over what is not linear in it (genBRDF, 3.6).

    The parameters of a fit that is there (`near`) join the starts.

    Raises `FittersError` where a parameter of the expression has no bounds. Never raises for a formula that is
    not finite: its error is infinite.
    """
    settings = settings or FitSettings()
    problem = _prepared(expression, cells, bounds)
    starts = _starts(expression, problem.low, problem.high, settings.starts)
    if near is not None:
        starts = np.concatenate([problem.coordinates(near.columns), starts])
    x, value = np.zeros((len(cells.weights), starts.shape[1])), np.full(len(cells.weights), np.inf)
    descent = settings.descent(starts.shape[1])
    used = problem.fit(starts, descent, x, value)
    return _finished(problem, metric, settings, x, value, used)


def refit(
    expression: Expression,
    cells: Cells,
    metric: Metric,
    bounds: Bounds,
    near: Fit,
    settings: FitSettings,
    *,
    evaluations: int,
) -> Fit:
    """The fit over other cells, all of them as a rule, by one descent from the parameters of a fit that is there.

    `evaluations` per searched parameter; with 0 only the linear parameters are solved anew.
    """
    problem = _prepared(expression, cells, bounds)
    x, value = problem.coordinates(near.columns), np.full(len(cells.weights), np.inf)
    return _finished(problem, metric, replace(settings, evaluations=evaluations), x, value, 0)


def _prepared(expression: Expression, cells: Cells, bounds: Bounds) -> Prepared:
    missing = [name for name in expression.parameters if name not in bounds]
    if missing:
        raise FittersError(f"no bounds for {', '.join(missing)} of {to_text(expression)}")
    coarse = cells.coarse and (cells.coarse.weights, cells.coarse.targets)
    return Prepared(expression, cells.features, cells.weights, cells.targets, bounds, coarse)


def _finished(
    problem: Prepared, metric: Metric, settings: FitSettings, x: NDArray, value: NDArray, used: int
) -> Fit:
    """Polishes every target's best and states the fit in the expression's own parameters."""
    c, evaluations = problem.polish(settings.descent(problem.searched), x, value)
    parameters = problem.parameters(x, c)
    values = np.stack(list(parameters.values()), axis=1) if parameters else np.empty((len(value), 0))
    errors = np.sqrt(value)
    return Fit(
        tuple(parameters), np.asarray(values, np.float64), errors, metric.combine(errors), used + evaluations
    )


def _starts(expression: Expression, low: Array, high: Array, count: int) -> Array:
    """Start coordinates (count, d), an additive recurrence with a random offset seeded by the expression."""
    d = len(low)
    if d == 0:
        return np.zeros((1, 0))
    seed = int.from_bytes(hashlib.sha256(to_text(expression).encode()).digest()[:8], "little")
    # Generalised golden ratio: the root of x^(d + 1) = x + 1 (Roberts 2018).
    ratio = 2.0
    for _ in range(40):
        ratio = (1.0 + ratio) ** (1.0 / (d + 1))
    steps = ratio ** -np.arange(1, d + 1)
    points = np.mod(np.random.default_rng(seed).random(d) + np.outer(np.arange(count), steps), 1.0)
    for i, (least, largest) in enumerate(RANGES):
        # Coordinates are logarithms where the parameter is bounded away from zero from below.
        first, last = np.maximum(low, np.log(least)), np.minimum(high, np.log(largest))
        narrow = first < last
        first, last = np.where(narrow, first, low), np.where(narrow, last, high)
        points[i :: len(RANGES)] = first + points[i :: len(RANGES)] * (last - first)
    return points
