"""The light of no scene in particular: radiance 1 from everywhere, over a sphere."""

from functools import cache

import numpy as np

from fitters import cache as disk
from fitters.grid import SHAPE
from fitters.scenes.sphere import RINGS, sphere_table
from fitters.scenes.table import LightTable


@cache
def uniform_light() -> LightTable:
    """The light table of radiance 1 from every direction, over all cells that reach above the horizon.

    All cells together carry pi, what a white surface reflects.
    """
    edges = np.cos(np.arange(RINGS * SHAPE[1] + 1) / (RINGS * SHAPE[1]) * np.pi)
    rings = 2.0 * np.pi * -np.diff(edges)
    table = sphere_table(np.repeat(rings[:, None], 3, axis=1)).astype(np.float32)
    return LightTable(table, table[0] > 0, disk.digest("uniform light"))
