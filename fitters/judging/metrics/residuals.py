"""Residuals: metrics that a fit can minimise, one of them in each run.

For a target with measured values m and light T over the lit, valid cells, every residual is

    e = || w (f - m) || / s

with weights w that depend on the measurement and the light only, so that one engine minimises them all.
"""

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

import numpy as np

from fitters.errors import FittersError
from fitters.grid import Array
from fitters.judging.metrics.contract import Compared, Comparison, Metric, PerChannel, over_channels

SORTED = 4096
"""Up to this number of values are sorted to find their median."""

COMPRESSIVE_POWER = 1.4
"""The power p of eq. 11 of the factor paper (Bagher et al. 2016)."""


@dataclass(frozen=True)
class Residual(Metric):
    """A residual's weights, its scale, and how errors of targets combine into the error of an expression.

    weights:    w (n,) of light T (n,) and measured values m (n,)
    normalised: whether errors are relative to the measurement
    """

    _: KW_ONLY
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

    def weighted(self, light: Array, measured: Array) -> tuple[Array, Array]:
        """w / s and w m / s (n,): the error of values f is || (w / s) f - w m / s ||."""
        weights = self.weights(light, measured)
        weights = weights / self.scale(weights, measured)
        return weights, weights * measured

    def errors(self, compared: Compared) -> PerChannel:
        """The error of each channel over the cells that the scene lights."""
        material, light = compared.material, compared.light
        index = np.flatnonzero(light.lit & material.valid)
        if not len(index):
            raise FittersError(f"{material.name}: the scene lights none of its cells; choose another light")
        channels = []
        for carried, measured, values in zip(light.table, material.table, compared.values, strict=True):
            columns = (table.ravel()[index].astype(np.float64) for table in (carried, measured, values))
            lit, target, model = columns
            weights, targets = self.weighted(lit, target)
            channels.append(length(weights * model - targets))
        return channels[0], channels[1], channels[2]

    def measure(self, compared: Compared) -> Comparison:
        return over_channels(self.errors(compared))

    def squares(self, error: float, targets: int) -> float:
        """The sum of squared errors over this number of targets from which `combine` makes this error."""
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

    Where that median is 0 it is taken over the positive values, since eq. 11 would make every other weight 0.
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
    # Halving the values that may be the median takes a fraction of the time of sorting.
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


_LIT = "per channel over valid cells that the scene lights, T the light through a cell"

COSINE = Residual(
    "cosine",
    "samples",
    "|| cos_i cos_o (f - m) || / || cos_i cos_o m || per channel over the samples of an anisotropic measurement",
    on_cards=False,
    weights=_light,
    normalised=True,
)
"""What anisotropic measurements are judged by; the cosines stand for the light."""

METRICS: tuple[Metric, ...] = (
    Residual(
        "light",
        "light table",
        f"|| T (f - m) || / || T m || {_LIT} (Brady et al. 2014, eq. 4, made relative)",
        label="light error",
        weights=_light,
        normalised=True,
    ),
    Residual(
        "compressive",
        "light table",
        f"|| w (f - m) || / || w m || {_LIT}, w being T damped where the measurement m is bright (Bagher et al. "
        "2016, eqs. 11 and 12)",
        label="compressive error",
        short="compr.",
        on_cards=False,
        weights=_compressive,
        normalised=True,
    ),
    Residual(
        "light-sum",
        "light table",
        f"|| T (f - m) || {_LIT} (Brady et al. 2014, eq. 4 as printed): bright materials outweigh others",
        unit="radiance",
        label="summed light error",
        on_cards=False,
        symmetric=True,
        weights=_light,
        normalised=False,
    ),
    COSINE,
)
