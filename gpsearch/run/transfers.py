"""What a run keeps of its models on test materials, which nothing was searched on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fitters.fitting import RESIDUALS, Description
from fitters.models import FitSummary


@dataclass(frozen=True)
class Transfer:
    """A model fitted to one test material.

    errors:     (channels,) by the run's metric, infinite where it could not be fitted
    metrics:    the error over the channels by every metric
    parameters: (channels,) each by name; empty for what is no formula
    warnings:   each begins with the material's name; why a fit failed is one of them
    """

    errors: tuple[float, ...]
    metrics: dict[str, float]
    parameters: dict[str, tuple[float, ...]]
    warnings: tuple[str, ...] = ()

    @classmethod
    def of_formula(cls, description: Description) -> "Transfer":
        """Of a formula's fit to the channels of the material."""
        fit = description.fit
        parameters = {name: tuple(values.tolist()) for name, values in fit.columns.items()}
        return cls(tuple(fit.errors.tolist()), description.metrics, parameters, description.warnings)

    @classmethod
    def of_table(cls, judged: FitSummary, metric: str) -> "Transfer":
        """Of a tabulated baseline, in a run of this metric."""
        metrics = {name: RESIDUALS[name].combine(np.array(errors)) for name, errors in judged.errors.items()}
        return cls(judged.errors[metric], metrics, {}, judged.warnings)


def combined(transfers: Sequence[Transfer]) -> dict[str, float]:
    """The error over all targets of some materials (not empty) by every metric.

    Every material has as many targets, so that errors of materials combine as those of targets do.
    """
    names = transfers[0].metrics
    return {name: RESIDUALS[name].combine(np.array([one.metrics[name] for one in transfers])) for name in names}
