"""Which cells a pixel sees, and by how much light: one row of the image map after the other."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fitters import compiled
from fitters.grid import CELLS, SHAPE, Array
from fitters.scenes.environment import EnvironmentMap
from fitters.scenes.kernel import cell_of

LEVELS = 4
"""A texel is one sample, or 4, 16 or 64."""
WIDTHS = 3.0
"""Samples of a texel lie closer than so many bins of theta_half, as far as `LEVELS` allows."""


def rows(
    light: EnvironmentMap, normals: Array, views: Array, visible: NDArray[np.bool_] | None
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float32]]:
    """Row pointers (p + 1,), cells (n,) rising in each row, and weights (n, 3): sums of L cos(theta_i) d omega.

    normals and views (p, 3); visible (p, texels) or None for all. Texels are constant, and are integrated by
    samples that are the denser the nearer their half vectors are to the normal, where BRDFs have their peaks.
    """
    emission = (light.radiance * light.solid_angles()[..., None]).reshape(-1, 3)
    shining = np.flatnonzero(emission.any(axis=1))
    samples = [_samples(light.rows, 1 << level)[shining] for level in range(LEVELS)]
    seen = np.ones((1, len(shining)), bool) if visible is None else np.ascontiguousarray(visible[:, shining])
    return _rows(
        np.ascontiguousarray(normals),
        np.ascontiguousarray(views),
        seen,
        emission[shining],
        np.ascontiguousarray(np.concatenate(samples, axis=1)),
        math.pi / light.rows / 2,
    )


def _samples(rows: int, across: int) -> Array:
    """Unit directions (texels, across^2, 3) of sub-texels of equal solid angle, texels row by row."""
    edges = np.cos(np.arange(rows + 1) / rows * np.pi)
    share = (np.arange(across) + 0.5) / across
    cos_theta = edges[:-1, None] + share * np.diff(edges)[:, None]
    phi = (np.arange(2 * rows)[:, None] + share) / rows * np.pi
    cos_theta = cos_theta[:, None, :, None]
    sin_theta, phi = np.sqrt(1 - cos_theta**2), phi[None, :, None, :]
    directions = np.broadcast_arrays(sin_theta * np.sin(phi), cos_theta, -sin_theta * np.cos(phi))
    return np.stack(directions, axis=-1).reshape(2 * rows**2, across**2, 3)


@compiled.entry()
def _rows(
    normals: Array, views: Array, seen: NDArray[np.bool_], emission: Array, samples: Array, extent: float
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float32]]:
    count = normals.shape[0]
    pointers = np.zeros(count + 1, np.int64)
    cells, weights = np.empty(1 << 20, np.int32), np.empty((1 << 20, 3), np.float32)
    sums, touched = np.zeros((CELLS, 3)), np.empty(CELLS, np.int32)
    for p in range(count):
        found = _row(normals[p], views[p], seen[p % len(seen)], emission, samples, extent, sums, touched)
        end = pointers[p] + found
        pointers[p + 1] = end
        while end > len(cells):
            cells = np.concatenate((cells, np.empty_like(cells)))
            weights = np.concatenate((weights, np.empty_like(weights)))
        touched[:found].sort()
        for k in range(found):
            cell = touched[k]
            cells[pointers[p] + k] = cell
            for c in range(3):
                weights[pointers[p] + k, c] = sums[cell, c]
                sums[cell, c] = 0.0
    return pointers, cells[: pointers[count]].copy(), weights[: pointers[count]].copy()


@njit
def _row(
    normal: Array,
    view: Array,
    seen: NDArray[np.bool_],
    emission: Array,
    samples: Array,
    extent: float,
    sums: Array,
    touched: NDArray[np.int32],
) -> int:
    """Adds what a pixel sees to `sums` (CELLS, 3), notes the cells in `touched`, and returns their number."""
    found = 0
    nx, ny, nz = normal
    for t in range(len(emission)):
        if not seen[t]:
            continue
        first, last = _level(normal, view, samples[t, 0], extent)
        share = 1.0 / (last - first)
        for s in range(first, last):
            w_i = samples[t, s]
            cos_i = nx * w_i[0] + ny * w_i[1] + nz * w_i[2]
            if cos_i <= 0.0:
                continue
            cell = cell_of(normal, w_i, view, cos_i)
            if sums[cell, 0] == 0.0 and sums[cell, 1] == 0.0 and sums[cell, 2] == 0.0:
                touched[found] = cell
                found += 1
            for c in range(3):
                sums[cell, c] += emission[t, c] * (cos_i * share)
    return found


@njit
def _level(normal: Array, view: Array, centre: Array, extent: float) -> tuple[int, int]:
    """The samples of a texel to use, by the bin of its half vectors; `extent` (radians) is how far they reach."""
    x, y, z = centre[0] + view[0], centre[1] + view[1], centre[2] + view[2]
    length = max(math.sqrt(x * x + y * y + z * z), 1e-12)
    cos_half = (normal[0] * x + normal[1] * y + normal[2] * z) / length
    nearest = max(math.acos(min(max(cos_half, -1.0), 1.0)) - extent / 2, extent / 8)
    # The bin at theta_half is 2 sqrt(theta_half pi / 2) / 90 wide.
    width = 2 * math.sqrt(nearest * (math.pi / 2)) / SHAPE[0]
    first, across = 0, 1
    for _ in range(LEVELS - 1):
        if across * WIDTHS * width >= extent:
            break
        first, across = first + across * across, 2 * across
    return first, first + across * across
