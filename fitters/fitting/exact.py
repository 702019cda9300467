"""The exact errors of a fit: the formula evaluated plainly in float64, which is what every report states."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.expressions import Expression
from fitters.expressions.evaluation import evaluate_features, parameter_free
from fitters.fitting.fit import Fit
from fitters.fitting.problem import CHANNELS, FitProblem, weighted_target
from fitters.grid import Array
from fitters.judging.metrics import RESIDUALS, Residual, length

BLOCK = 1 << 15
"""Cells that are evaluated at a time."""


@dataclass(frozen=True, eq=False)
class ExactErrors:
    """by_metric: (targets,) errors by metric name, infinite for a target where the formula is not finite on some
    lit cell; minimum: the smallest value of the formula over targets and lit cells, sr^-1.
    """

    by_metric: dict[str, NDArray[np.float64]]
    minimum: float


def exact_errors(expression: Expression, problem: FitProblem, found: Fit) -> ExactErrors:
    """The errors of a fit over all cells of a problem, by every metric, evaluated in float64 with NumPy."""
    errors = {name: np.empty(len(problem.targets)) for name in RESIDUALS}
    minimum = np.inf
    for first in range(0, len(problem.targets), len(CHANNELS)):
        of_material = range(first, first + len(CHANNELS))
        for target, values in zip(of_material, _values(expression, problem, found, of_material), strict=True):
            minimum = min(minimum, float(values.min()))
            for name, metric in RESIDUALS.items():
                weights, targets = _rows(problem, metric, target)
                with np.errstate(all="ignore"):
                    error = length(weights * values - targets)
                errors[name][target] = error if np.isfinite(error) else np.inf
    return ExactErrors(errors, minimum)


def _values(expression: Expression, problem: FitProblem, found: Fit, targets: Sequence[int]) -> Array:
    """The formula (targets, n) on all cells, block by block: a long formula has many values in between."""
    features, count = problem.full.features, len(problem.full)
    values = np.empty((len(targets), count))
    parameters = [found.parameters(target) for target in targets]
    for at in range(0, count, BLOCK):
        block = {name: of_cells[at : at + BLOCK] for name, of_cells in features.items()}
        shared = parameter_free(expression, block)
        for row, given in zip(values, parameters, strict=True):
            row[at : at + BLOCK] = evaluate_features(expression, given, block, shared)
    return values


def _rows(problem: FitProblem, metric: Residual, target: int) -> tuple[Array, Array]:
    """Weights and weighted values (n,) of a target; what the problem does not hold is made for the moment."""
    if metric is problem.metric:
        return problem.full.weights[target], problem.full.targets[target]
    return weighted_target(problem.source, metric, target)
