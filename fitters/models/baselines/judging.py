"""The errors of a baseline in the scene of a fit problem: the same metrics as every formula's."""

import math
import time
from dataclasses import dataclass

import numpy as np

from fitters.errors import FittersError
from fitters.fitting.problem import CHANNELS, FitProblem, Source, weighted_target
from fitters.grid import cell_directions
from fitters.judging.metrics import COSINE, RESIDUALS, length
from fitters.materials import AnisotropicMaterial
from fitters.materials.utia import sample_directions
from fitters.models import Model
from fitters.models.baselines.kept import kept_baseline

PerChannel = tuple[float, float, float]


@dataclass(frozen=True)
class BaselineJob:
    """A baseline that is no formula, by name, and which of a problem's materials it is fitted to."""

    name: str
    material: int


@dataclass(frozen=True)
class Judged:
    """A baseline fitted to one material: errors per channel by metric, size, seconds, cost, warnings.

    Where it cannot be fitted, the errors are infinite, size and cost are 0, and a warning says why. Every warning
    begins with the material's name.
    """

    errors: dict[str, PerChannel]
    floats: int
    fit_seconds: float
    cost_ns: float
    warnings: tuple[str, ...]


def judge_baseline(problem: FitProblem, job: BaselineJob) -> Judged:
    """Fits a baseline to one material of a problem and judges it there."""
    material = problem.source.materials[job.material]
    began = time.perf_counter()
    try:
        fitted = kept_baseline(job.name, material)
    except FittersError as error:
        # Data, not an exception: what one material lacks must not end a run over many.
        infinite = dict.fromkeys(RESIDUALS, (math.inf, math.inf, math.inf))
        return Judged(infinite, 0, time.perf_counter() - began, 0.0, (_about(material.name, str(error)),))
    model = fitted.model
    errors = judge(problem, job.material, model)
    warnings = tuple(_about(material.name, warning) for warning in fitted.warnings)
    return Judged(errors, model.floats, model.fit_seconds, model.cost_ns(), warnings)


def _about(material: str, sentence: str) -> str:
    """The sentence with the material's name before it; errors have it already."""
    return sentence if sentence.startswith(f"{material}: ") else f"{material}: {sentence}"


def judge(problem: FitProblem, material: int, model: Model) -> dict[str, PerChannel]:
    """Errors (red, green, blue) of a model of one material over all cells of a problem, by every metric."""
    return judge_at(problem.source, material, model)


def judge_at(source: Source, material: int, model: Model) -> dict[str, PerChannel]:
    """As `judge`, of which only the cells, the light and the material are needed."""
    w_i, w_o = cell_directions()
    values = model.evaluate(w_i[source.index], w_o[source.index])
    errors = {}
    for name, metric in RESIDUALS.items():
        channels = []
        for c in range(len(CHANNELS)):
            weights, targets = weighted_target(source, metric, len(CHANNELS) * material + c)
            channels.append(length(weights * values[:, c] - targets))
        errors[name] = (channels[0], channels[1], channels[2])
    return errors


def judge_anisotropic(material: AnisotropicMaterial, model: Model) -> PerChannel:
    """|| cos_i cos_o (f - m) || / || cos_i cos_o m || of each channel over the samples of a measurement.

    No light table holds anisotropic cells; the cosines count a sample by what a patch sends and receives. A
    channel that is 0 throughout has || cos_i cos_o f || / || cos_i cos_o || instead, as with any metric.
    """
    w_i, w_o = sample_directions()
    cosines = w_i[:, 2] * w_o[:, 2]
    values = model.evaluate(w_i, w_o)
    red, green, blue = (
        length(cosines * (values[:, c] - measured)) / COSINE.scale(cosines, measured)
        for c, measured in enumerate(material.table.reshape(len(CHANNELS), -1).astype(np.float64))
    )
    return red, green, blue
