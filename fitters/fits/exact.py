"""The exact errors of a fit: the formula evaluated plainly in float64, which is what every report states."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.expressions import Expression
from fitters.expressions.evaluation import evaluate_features, parameter_free
from fitters.fits.fit import Fit
from fitters.fits.metrics import METRICS, Metric, length
from fitters.fits.problem import FitProblem, weighted_target
from fitters.grid import Array


@dataclass(frozen=True, eq=False)
class ExactErrors:
    """by_metric: (targets,) errors by metric name, infinite for a target where the formula is not finite on some
    lit cell; minimum: the smallest value of the formula over targets and lit cells, sr^-1.
    """

    by_metric: dict[str, NDArray[np.float64]]
    minimum: float


def exact_errors(expression: Expression, problem: FitProblem, found: Fit) -> ExactErrors:
    """The errors of a fit over all cells of a problem, by every metric, evaluated in float64 with NumPy."""
    errors = {name: np.empty(len(problem.targets)) for name in METRICS}
    minimum = np.inf
    shared = parameter_free(expression, problem.full.features)
    for target in range(len(problem.targets)):
        values = evaluate_features(expression, found.parameters(target), problem.full.features, shared)
        minimum = min(minimum, float(values.min()))
        for name, metric in METRICS.items():
            weights, targets = _rows(problem, metric, target)
            with np.errstate(all="ignore"):
                error = length(weights * values - targets)
            errors[name][target] = error if np.isfinite(error) else np.inf
    return ExactErrors(errors, minimum)


def _rows(problem: FitProblem, metric: Metric, target: int) -> tuple[Array, Array]:
    """Weights and weighted values (n,) of a target; what the problem does not hold is made for the moment."""
    if metric is problem.metric:
        return problem.full.weights[target], problem.full.targets[target]
    return weighted_target(problem.source, metric, target)
