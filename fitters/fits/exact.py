"""The exact errors of a fit: the formula evaluated plainly in float64, which is what every report states."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.expressions import Expression
from fitters.expressions.evaluation import evaluate_features
from fitters.fits.fit import Fit
from fitters.fits.problem import FitProblem


@dataclass(frozen=True, eq=False)
class ExactErrors:
    """by_metric: (targets,) errors by metric name, infinite for a target where the formula is not finite on some
    lit cell; minimum: the smallest value of the formula over targets and lit cells, sr^-1.
    """

    by_metric: dict[str, NDArray[np.float64]]
    minimum: float


def exact_errors(expression: Expression, problem: FitProblem, found: Fit) -> ExactErrors:
    """The errors of a fit over all cells of a problem, by every metric, evaluated in float64 with NumPy."""
    weighted = problem.full_by_metric
    errors = {name: np.empty(len(problem.targets)) for name in weighted}
    minimum = np.inf
    for target in range(len(problem.targets)):
        values = evaluate_features(expression, found.parameters(target), problem.full.features)
        minimum = min(minimum, float(values.min()))
        for name, cells in weighted.items():
            with np.errstate(all="ignore"):
                error = np.linalg.norm(cells.weights[target] * values - cells.targets[target])
            errors[name][target] = error if np.isfinite(error) else np.inf
    return ExactErrors(errors, minimum)
