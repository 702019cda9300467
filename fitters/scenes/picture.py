"""Pictures of a scene's sphere with the materials of tables."""

import numpy as np

from fitters import compiled
from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, Array
from fitters.scenes.environment import EnvironmentMap
from fitters.scenes.kernel import cell_seen, half_frames, sphere_normals


def pictures(light: EnvironmentMap, resolution: int, tables: Array) -> Array:
    """Radiance (m, pixels, 3) of the sphere's pixels with m BRDFs (m, 3, 90, 90, 180) in sr^-1 on the grid.

    The pixels are those of `sphere_normals(resolution)`, all that show the sphere; the camera is that of `Scene`.
    The mean over the pixels is the dot product of the light table and the BRDF.
    """
    count = len(tables)
    if tables.shape != (count, 3, *SHAPE):
        raise FittersError(f"pictures take tables (m, 3, 90, 90, 180), not {tables.shape}")
    emission = light.radiance * light.solid_angles()[..., None]
    shining = emission.any(axis=-1)
    rows = np.ascontiguousarray(tables.reshape(3 * count, CELLS).T, np.float32)
    normals = sphere_normals(resolution)
    image = np.zeros((len(normals), 3 * count))
    _shade(normals, light.directions()[shining], emission[shining], rows, image)
    return np.ascontiguousarray(image.reshape(len(normals), count, 3).transpose(1, 0, 2))


@compiled.entry()
def _shade(normals: Array, directions: Array, emission: Array, rows: Array, image: Array) -> None:
    """Add to `image` (pixels, 3 m) what `emission` (texels, 3) makes of `rows` (CELLS, 3 m)."""
    frames, cos_diff, diff_bins = half_frames(directions)
    count = rows.shape[1] // 3
    for p in range(normals.shape[0]):
        nx, ny, nz = normals[p]
        for t in range(directions.shape[0]):
            cos_i = nx * directions[t, 0] + ny * directions[t, 1] + nz * directions[t, 2]
            if cos_i <= 0.0:
                continue
            cell = cell_seen(nx, ny, nz, cos_i, frames[t], cos_diff[t], diff_bins[t])
            for k in range(count):
                for c in range(3):
                    image[p, 3 * k + c] += emission[t, c] * cos_i * rows[cell, 3 * k + c]
