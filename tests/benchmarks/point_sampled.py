"""The light table as it is by one point a pixel and a texel: what happens where nobody asks for convergence."""

import numpy as np
from numba import njit

from fitters import cache
from fitters.grid import CELLS, SHAPE, Array
from fitters.scenes import EnvironmentMap, LightTable
from fitters.scenes.cells import cell_of
from fitters.scenes.geometry import sphere


def point_sampled(light: EnvironmentMap, resolution: int, light_rows: int) -> LightTable:
    """The table of the sphere at so many pixels across, the map reduced to so many rows."""
    reduced = light.reduced(light_rows)
    emission = (reduced.radiance * reduced.solid_angles()[..., None]).reshape(-1, 3)
    normals, table = sphere(resolution).normals, np.zeros((CELLS, 3))
    _gather(normals, reduced.directions().reshape(-1, 3), emission, table)
    made = np.ascontiguousarray(table.T.reshape(3, *SHAPE) / len(normals), np.float32)
    key = cache.digest("point sampled", light.radiance, resolution, light_rows)
    return LightTable(made, np.any(made > 0, axis=0), key)


@njit
def _gather(normals: Array, directions: Array, emission: Array, table: Array) -> None:
    view = np.array([0.0, 0.0, 1.0])
    for normal in normals:
        for t in range(len(directions)):
            cos_i = normal[0] * directions[t, 0] + normal[1] * directions[t, 1] + normal[2] * directions[t, 2]
            if cos_i > 0.0:
                cell = cell_of(normal, directions[t], view, cos_i)
                for c in range(3):
                    table[cell, c] += emission[t, c] * cos_i
