"""How far a model is from a measurement as a table: the error under the light, and two that see no scene.

Each with its protocol in words, as the image metrics of `fitters.rendering` have.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fitters.errors import FittersError
from fitters.fitting.problem import Problem, weighted_target
from fitters.grid import CHANNELS, SHAPE, Array, cell_directions
from fitters.judging.metrics import METRICS, length
from fitters.materials import Material
from fitters.scenes import LightTable

PerChannel = tuple[float, float, float]

_CELLS = (
    "root mean square per channel over all valid cells, lit or not, each counting alike (the MERL grid itself is "
    "densest at the highlight); cos theta is taken at both directions of a cell, since the table stands for both "
    "ways of the light"
)


@dataclass(frozen=True)
class TableMetric:
    """An error of each channel; `curve` is what values times a cosine go through, None for the light error."""

    name: str
    unit: str
    protocol: str
    curve: Callable[[Array], Array] | None


TABLE_METRICS = {
    metric.name: metric
    for metric in (
        TableMetric(
            name="light",
            unit="",
            protocol="|| T (f - m) || / || T m || per channel over valid cells that the scene lights, T the light "
            "through a cell (Brady et al. 2014, eq. 4, made relative)",
            curve=None,
        ),
        TableMetric(
            name="cosine-log",
            unit="",
            protocol=f"difference of log(1 + f cos theta), f in sr^-1 (Low et al. 2012, E2); {_CELLS}",
            curve=lambda light: np.log1p(light),
        ),
        TableMetric(
            name="cosine-cube-root",
            unit="sr^-1/3",
            protocol=f"difference of (f cos theta)^(1/3) (Fores et al. 2012); {_CELLS}",
            curve=lambda light: np.cbrt(light),
        ),
    )
}


def table_errors(material: Material, light: LightTable, values: Array) -> dict[str, PerChannel]:
    """Errors (red, green, blue) by every metric of a model's values (3, 90, 90, 180) in sr^-1, not negative.

    Values where the material is not valid do not count. Raises `FittersError` for values of another shape, or
    where the light meets no valid cell.
    """
    if values.shape != (3, *SHAPE):
        raise FittersError(f"{material.name}: a model's values are (3, 90, 90, 180), not {values.shape}")
    errors = {}
    for name, metric in TABLE_METRICS.items():
        if metric.curve is None:
            errors[name] = _light_error(material, light, values)
        else:
            errors[name] = _curved_error(material, values, metric.curve)
    return errors


def _light_error(material: Material, light: LightTable, values: Array) -> PerChannel:
    source = Problem([material], light)
    channels = []
    for c in range(len(CHANNELS)):
        weights, targets = weighted_target(source, METRICS["light"], c)
        found = values[c].ravel()[source.index].astype(np.float64)
        channels.append(length(weights * found - targets))
    return channels[0], channels[1], channels[2]


def _curved_error(material: Material, values: Array, curve: Callable[[Array], Array]) -> PerChannel:
    index = np.flatnonzero(material.valid)
    cosines = [w[index, 2] for w in cell_directions()]
    channels = []
    for c in range(len(CHANNELS)):
        found, measured = (table[c].ravel()[index].astype(np.float64) for table in (values, material.table))
        ends = [length(curve(found * cosine) - curve(measured * cosine)) for cosine in cosines]
        channels.append(math.hypot(*ends) / math.sqrt(2 * len(index)))
    return channels[0], channels[1], channels[2]
