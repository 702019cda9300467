"""The fit as it is written without an engine: SciPy over a tree that NumPy evaluates in float64."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares, minimize

from fitters.expressions import Expression
from fitters.expressions.evaluation import evaluate_features
from fitters.fitting.cells import Cells
from fitters.fitting.settings import Bounds
from fitters.grid import Array

EVALUATIONS = 200
"""Of a descent."""

START = (1e-3, 1e2)
"""Parameters start in this range, within their bounds; log-uniformly."""

WORST = 1e6
"""Stands for a weighted residual that is not finite."""


class PlainFit:
    """One target: every parameter is searched, in logarithms; `x` (parameters,) holds these."""

    def __init__(self, expression: Expression, bounds: Bounds, cells: Cells, target: int) -> None:
        self.expression, self.features = expression, cells.features
        self.box = np.log([bounds[name] for name in expression.parameters])
        self.weights = cells.weights[target].astype(np.float64)
        self.targets = cells.targets[target].astype(np.float64)

    def error(self, x: Array) -> float:
        """The error, infinite where the formula is not finite on some cell."""
        return self.error_with(dict(zip(self.expression.parameters, np.exp(x), strict=True)))

    def error_with(self, parameters: Mapping[str, float]) -> float:
        """The error for parameters as they are, not logarithms."""
        with np.errstate(over="ignore"):
            error = float(np.linalg.norm(self._differences(parameters)))
        return error if np.isfinite(error) else np.inf

    def start(self, rng: np.random.Generator) -> Array:
        low, high = (np.clip(np.log(end), *self.box.T) for end in START)
        return low + (high - low) * rng.random(len(self.box))

    def descend(self, x: Array) -> Array:
        """The end of one Nelder-Mead descent from x."""
        return minimize(
            lambda point: float(np.sum(np.square(self._residuals(point)))),
            x,
            method="Nelder-Mead",
            bounds=self.box,
            options={"maxfev": EVALUATIONS},
        ).x

    def descents(self, starts: Sequence[Array]) -> list[Array]:
        return [self.descend(start) for start in starts]

    def polish(self, x: Array) -> Array:
        """The end of a trust-region least-squares descent from x."""
        # Strictly inside the box, as the method wants it.
        inside = np.clip(x, self.box[:, 0] + 1e-9, self.box[:, 1] - 1e-9)
        return least_squares(self._residuals, inside, bounds=self.box.T, max_nfev=100).x

    def _residuals(self, x: Array) -> Array:
        """Weighted residuals (n,), made finite."""
        found = self._differences(dict(zip(self.expression.parameters, np.exp(x), strict=True)))
        return np.clip(np.nan_to_num(found, nan=WORST), -WORST, WORST)

    def _differences(self, parameters: Mapping[str, float]) -> Array:
        with np.errstate(invalid="ignore"):
            return self.weights * evaluate_features(self.expression, parameters, self.features) - self.targets
