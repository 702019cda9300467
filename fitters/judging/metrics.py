"""Which residual a fit minimises: one named choice per run.

For a target with measured values m and light T over the lit, valid cells, every metric is a weighted residual

    e = || w (f - m) || / s

with weights w that depend on the measurement and the light only, so that one engine minimises them all.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fitters.grid import Array

SORTED = 4096
"""So many values are sorted to find their median."""

COMPRESSIVE_POWER = 1.4
"""The power p of eq. 11 of the factor paper (Bagher et al. 2016)."""


@dataclass(frozen=True)
class Metric:
    """A residual's weights, its scale, and how errors of targets combine into the error of an expression."""

    name: str
    weights: Callable[[Array, Array], Array]
    normalised: bool

    def scale(self, weights: Array, measured: Array) -> float:
        """s, by which the residual of a target is divided: || w m ||, or 1 where the metric is a plain sum.

        For a measurement that is zero wherever there is light, || w ||: the error is then in sr^-1. For a channel
        without light 1: its error is 0 whatever the formula.
        """
        if not self.normalised:
            return 1.0
        return length(weights * measured) or length(weights) or 1.0

    def squares(self, error: float, targets: int) -> float:
        """The sum of squared errors over so many targets that `combine` makes this error of."""
        return error * error * (targets if self.normalised else 1)

    def combine(self, errors: Array) -> float:
        """One number for the errors (targets,): their root mean square, or L2 norm where unnormalised."""
        squares = float(np.sum(np.square(errors, dtype=np.float64)))
        return float(np.sqrt(squares / len(errors) if self.normalised else squares))


def length(values: Array) -> float:
    """|| values ||, added up in one order; that of BLAS, and with it the last bits, depends on its threads."""
    return float(np.sqrt(np.sum(np.square(values, dtype=np.float64))))


def _light(light: Array, measured: Array) -> Array:
    return light


def _compressive(light: Array, measured: Array) -> Array:
    """T sqrt(w_C) with w_C after eqs. 11 and 12 of the factor paper, rho-bar the light-weighted median.

    Where that is 0, it is the median of what is not: of 0, eq. 11 would make every other weight 0.
    """
    middle, positive = weighted_median(measured, light), measured > 0
    if middle <= 0:
        middle = weighted_median(measured[positive], light[positive]) if positive.any() else 1.0
    ratio = np.maximum(measured, 0.0) / middle
    alpha = np.log(2.0)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        compressed = np.where(ratio > 0, -np.expm1(-alpha * ratio) / (alpha * ratio), 1.0)
    return light * compressed ** (COMPRESSIVE_POWER / 2)


def weighted_median(values: Array, weights: Array) -> float:
    """The smallest value that at least half of the weight does not exceed."""
    below, half = 0.0, 0.5 * float(np.sum(weights, dtype=np.float64))
    # Halves what may be it again and again, which takes a fraction of the time of sorting.
    while len(values) > SORTED:
        pivot = np.partition(values, len(values) // 2)[len(values) // 2]
        low = values < pivot
        lighter = below + float(np.sum(weights[low], dtype=np.float64))
        keep = low if lighter >= half else ~low
        below = below if lighter >= half else lighter
        if keep.all():
            break
        values, weights = values[keep], weights[keep]
    order = np.argsort(values)
    cumulative = below + np.cumsum(weights[order], dtype=np.float64)
    return float(values[order][min(int(np.searchsorted(cumulative, half)), len(values) - 1)])


METRICS = {
    metric.name: metric
    for metric in (
        # eq. 4 of the genBRDF paper, relative to the measurement
        Metric("light", _light, normalised=True),
        # the same, damped where the measurement is bright
        Metric("compressive", _compressive, normalised=True),
        # eq. 4 as printed: bright materials dominate
        Metric("light-sum", _light, normalised=False),
    )
}
