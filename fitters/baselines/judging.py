"""The errors of a baseline in the scene of a fit problem: the same metrics as every formula's."""

from dataclasses import dataclass

import numpy as np

from fitters.baselines.names import fit_baseline
from fitters.fits.metrics import METRICS
from fitters.fits.problem import CHANNELS, FitProblem, weighted_target
from fitters.grid import cell_directions
from fitters.models import Model


@dataclass(frozen=True)
class BaselineJob:
    """A baseline that is no formula, by name, and which of a problem's materials it is fitted to."""

    name: str
    material: int


@dataclass(frozen=True)
class Judged:
    """A baseline fitted to one material: errors per channel by metric, size, seconds, cost, warnings."""

    errors: dict[str, tuple[float, float, float]]
    floats: int
    fit_seconds: float
    cost_ns: float
    warnings: tuple[str, ...]


def judge_baseline(problem: FitProblem, job: BaselineJob) -> Judged:
    """Fits a baseline to one material of a problem and judges it there."""
    fitted = fit_baseline(job.name, problem.source.materials[job.material])
    model = fitted.model
    errors = judge(problem, job.material, model)
    return Judged(errors, model.floats, model.fit_seconds, model.cost_ns(), fitted.warnings)


def judge(problem: FitProblem, material: int, model: Model) -> dict[str, tuple[float, float, float]]:
    """Errors (red, green, blue) of a model of one material over all cells of a problem, by every metric."""
    w_i, w_o = cell_directions()
    index = problem.source.index
    values = model.evaluate(w_i[index], w_o[index])
    errors = {}
    for name, metric in METRICS.items():
        channels = []
        for c in range(len(CHANNELS)):
            weights, targets = weighted_target(problem.source, metric, len(CHANNELS) * material + c)
            channels.append(float(np.linalg.norm(weights * values[:, c] - targets)))
        errors[name] = (channels[0], channels[1], channels[2])
    return errors
