"""How models of a run do on materials that it was not searched on, as figures 6 and 9 of the genBRDF paper say it.

A score is what a metric says of a model of one material: `error`, the run's metric over the three channels, or an
image metric. It is None where the model could not be fitted, or its picture is not finite.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fitters.errors import FittersError
from fitters.fitting import RESIDUALS
from fitters.judging.metrics import IMAGE_METRICS
from fitters.materials import Material
from fitters.rendering import ImageMap, Picture
from gpsearch.judging.contenders import Contender

ERROR = "error"
IMAGES = ("l2", "1-ssim", "psnr")
COMPARED = (ERROR, "l2", "1-ssim")
"""Scores of which the share is told that a model lies below a reference. 0 is best; decibels have no shares."""

Scores = Mapping[str, float | None]
"""By metric: `ERROR` and `IMAGES`."""


@dataclass(frozen=True, eq=False)
class Scored:
    """A contender with its scores, by material's name."""

    contender: Contender
    scores: Mapping[str, Scores]

    def score(self, material: str, metric: str) -> float | None:
        return self.scores[material][metric]

    def mean(self, materials: Sequence[str], metric: str) -> float | None:
        """Over materials (not empty); None where one has no score."""
        return _mean([self.scores[name][metric] for name in materials])

    def below(self, reference: "Scored", material: str, metric: str) -> float | None:
        """1 - score / reference's: the share of a reference's error that is gone; negative where there is more."""
        new, old = self.scores[material][metric], reference.scores[material][metric]
        return None if new is None or not old else 1.0 - new / old

    def mean_below(self, reference: "Scored", materials: Sequence[str], metric: str) -> float | None:
        """The mean of the shares of materials (not empty), as the paper's averages are."""
        return _mean([self.below(reference, name, metric) for name in materials])


def scored(
    contenders: Sequence[Contender], materials: Sequence[Material], image: ImageMap, metric: str
) -> Iterator[Scored]:
    """Every contender with its scores on all materials; `metric` is the run's.

    Raises `FittersError` where a material is black in the image.
    """
    truths = {material.name: image.of_material(material) for material in materials}
    for contender in contenders:
        yield Scored(contender, {m.name: _scores(contender, m, truths[m.name], image, metric) for m in materials})


def _scores(
    contender: Contender, material: Material, truth: Picture, image: ImageMap, metric: str
) -> dict[str, float | None]:
    scores: dict[str, float | None] = dict.fromkeys((ERROR, *IMAGES))
    errors = contender.entry.all_errors[material.name]
    if None not in errors:
        scores[ERROR] = RESIDUALS[metric].combine(np.array(errors))
    if material.name in contender.models:
        try:
            picture = image.of_model(contender.models[material.name], material)
        except FittersError:
            return scores  # not finite in some pixel
        for name in IMAGES:
            scores[name] = _finite(IMAGE_METRICS[name].compare(truth, picture).value)
    return scores


def _finite(value: float) -> float | None:
    """The PSNR of equal pictures is no number."""
    return value if math.isfinite(value) else None


def _mean(values: Sequence[float | None]) -> float | None:
    there = [value for value in values if value is not None]
    return float(np.mean(there)) if len(there) == len(values) else None
