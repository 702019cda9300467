"""The exact errors of a fit, of a formula or of any model: evaluated plainly in float64, as reports state them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fitters.expressions import Expression
from fitters.expressions.evaluation import evaluate_features, parameter_free
from fitters.fitting.cell_fit import Fit
from fitters.fitting.problem import Problem, weighted_target
from fitters.grid import CHANNELS, Array, cell_directions
from fitters.judging.metrics import COSINE, RESIDUALS, Residual, length
from fitters.materials.utia import sample_directions

PerChannel = tuple[float, float, float]

BLOCK = 1 << 15
"""Cells that are evaluated at a time."""


@dataclass(frozen=True, eq=False)
class ExactErrors:
    """by_metric: (targets,) errors by metric name, infinite for a target where the formula is not finite on some
    lit cell; minimum: the smallest value of the formula over targets and lit cells, sr^-1.
    """

    by_metric: dict[str, NDArray[np.float64]]
    minimum: float


def exact_errors(expression: Expression, problem: Problem, fit: Fit) -> ExactErrors:
    """The errors of a fit over all cells of a problem, by every metric, evaluated in float64 with NumPy."""
    errors = {name: np.empty(len(problem.targets)) for name in RESIDUALS}
    minimum = np.inf
    for first in range(0, len(problem.targets), len(CHANNELS)):
        of_material = range(first, first + len(CHANNELS))
        for target, values in zip(of_material, _values(expression, problem, fit, of_material), strict=True):
            minimum = min(minimum, float(values.min()))
            for name, metric in RESIDUALS.items():
                weights, targets = _rows(problem, metric, target)
                with np.errstate(all="ignore"):
                    error = length(weights * values - targets)
                errors[name][target] = error if np.isfinite(error) else np.inf
    return ExactErrors(errors, minimum)


def _values(expression: Expression, problem: Problem, fit: Fit, targets: Sequence[int]) -> Array:
    """The formula (targets, n) on all cells, block by block: a long formula has many values in between."""
    features, count = problem.full.features, len(problem.full)
    values = np.empty((len(targets), count))
    parameters = [fit.parameters(target) for target in targets]
    for at in range(0, count, BLOCK):
        block = {name: of_cells[at : at + BLOCK] for name, of_cells in features.items()}
        shared = parameter_free(expression, block)
        for row, given in zip(values, parameters, strict=True):
            row[at : at + BLOCK] = evaluate_features(expression, given, block, shared)
    return values


def _rows(problem: Problem, metric: Residual, target: int) -> tuple[Array, Array]:
    """Weights and weighted values (n,) of a target; what the problem does not hold is made for the moment."""
    if metric is problem.metric:
        return problem.full.weights[target], problem.full.targets[target]
    return weighted_target(problem, metric, target)


class Evaluated(Protocol):
    """What errors are measured of: a model of one material."""

    def evaluate(self, w_i: Array, w_o: Array) -> Array: ...


def model_errors(problem: Problem, material: int, model: Evaluated) -> dict[str, PerChannel]:
    """Errors (red, green, blue) of a model of one of a problem's materials over all its cells, by every metric."""
    if problem.anisotropic:
        return {COSINE.name: _anisotropic_errors(problem.measurements[material].table, model)}
    w_i, w_o = cell_directions()
    values = model.evaluate(w_i[problem.index], w_o[problem.index])
    errors = {}
    for name, metric in RESIDUALS.items():
        channels = []
        for c in range(len(CHANNELS)):
            weights, targets = weighted_target(problem, metric, len(CHANNELS) * material + c)
            channels.append(length(weights * values[:, c] - targets))
        errors[name] = (channels[0], channels[1], channels[2])
    return errors


def _anisotropic_errors(table: Array, model: Evaluated) -> PerChannel:
    """|| cos_i cos_o (f - m) || / || cos_i cos_o m || of each channel over the samples of a measurement.

    No light table holds anisotropic cells; the cosines count a sample by what a patch sends and receives. A
    channel that is 0 throughout has || cos_i cos_o f || / || cos_i cos_o || instead, as with any metric.
    """
    w_i, w_o = sample_directions()
    cosines = w_i[:, 2] * w_o[:, 2]
    values = model.evaluate(w_i, w_o)
    red, green, blue = (
        length(cosines * (values[:, c] - measured)) / COSINE.scale(cosines, measured)
        for c, measured in enumerate(table.reshape(len(CHANNELS), -1).astype(np.float64))
    )
    return red, green, blue
