"""The objective of eq. 7 for any model: what a fit of factors minimises, as a yardstick for all."""

import numpy as np

from fitters.grid import CELLS, SHAPE, cell_directions
from fitters.materials import Material
from fitters.models.factors.samples import samples
from fitters.models.model import Model


def objective(material: Material, model: Model) -> tuple[float, float, float]:
    """Eq. 7 of Bagher et al. 2016 per channel, of a model's values at the centres of the cells."""
    values = model.evaluate(*cell_directions()).T.reshape(3, CELLS // SHAPE[2], SHAPE[2])
    sums = []
    for channel, of in zip(values, samples(material, folded=False), strict=True):
        at = of.geometry
        sums.append(float(np.sum(of.weights * (channel[at.row, at.azimuth] - of.values) ** 2)))
    return sums[0], sums[1], sums[2]
