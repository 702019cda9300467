"""Errors on the table of a measurement that see no scene: every valid cell counts alike."""

import math
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

import numpy as np

from fitters.grid import Array, cell_directions
from fitters.judging.metrics.contract import Compared, Comparison, Metric, PerChannel, over_channels
from fitters.judging.metrics.residuals import length

_CELLS = (
    "root mean square per channel over all valid cells, lit or not, each counting alike (the MERL grid itself is "
    "densest at the highlight); cos theta is taken at both directions of a cell, since the table stands for both "
    "ways of the light"
)


@dataclass(frozen=True)
class TableMetric(Metric):
    """A difference of values times a cosine after both went through `curve`."""

    _: KW_ONLY
    curve: Callable[[Array], Array]

    def errors(self, compared: Compared) -> PerChannel:
        """The error of each channel."""
        material = compared.material
        index = np.flatnonzero(material.valid)
        cosines = [w[index, 2] for w in cell_directions()]
        channels = []
        for of_model, of_material in zip(compared.values, material.table, strict=True):
            values, measured = (table.ravel()[index].astype(np.float64) for table in (of_model, of_material))
            ends = [length(self.curve(values * cosine) - self.curve(measured * cosine)) for cosine in cosines]
            channels.append(math.hypot(*ends) / math.sqrt(2 * len(index)))
        return channels[0], channels[1], channels[2]

    def measure(self, compared: Compared) -> Comparison:
        return over_channels(self.errors(compared))


METRICS: tuple[Metric, ...] = (
    TableMetric(
        "cosine-log",
        "table",
        f"difference of log(1 + f cos theta), f in sr^-1 (Low et al. 2012, E2); {_CELLS}",
        short="cos-log",
        symmetric=True,
        curve=np.log1p,
    ),
    TableMetric(
        "cosine-cube-root",
        "table",
        f"difference of (f cos theta)^(1/3) (Fores et al. 2012); {_CELLS}",
        unit="sr^-1/3",
        short="cos-cbrt",
        symmetric=True,
        curve=np.cbrt,
    ),
)
