"""The integration: every pixel meets every texel once, in a fixed order, without noise."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fitters import compiled
from fitters.grid import CELLS, SHAPE, Array
from fitters.scenes.environment import EnvironmentMap

DISC = 0.998
"""Pixels with x^2 + y^2 below this belong to the sphere; the grazing rest is left out."""


def sphere_normals(resolution: int) -> Array:
    """Unit normals (pixels, 3) where the sphere is seen, row by row from the bottom; +x is right, +y up."""
    axis = (np.arange(resolution) + 0.5) / resolution * 2 - 1
    x, y = np.meshgrid(axis, axis)
    squared = x**2 + y**2
    seen = squared < DISC
    return np.stack([x[seen], y[seen], np.sqrt(1 - squared[seen])], axis=-1)


def integrate(light: EnvironmentMap, normals: Array) -> Array:
    """Light through each cell (3, 90, 90, 180), float64: sums of L cos(theta_i) d omega per pixel.

    The mean is over `normals` (pixels, 3), which are unit and face the camera (z > 0) at w_o = (0, 0, 1).
    """
    emission = light.radiance * light.solid_angles()[..., None]
    shining = emission.any(axis=-1)
    table = np.zeros((CELLS, 3))
    _gather(np.ascontiguousarray(normals), light.directions()[shining], emission[shining], table)
    return np.ascontiguousarray(table.T).reshape(3, *SHAPE) / len(normals)


@compiled.entry()
def _gather(normals: Array, directions: Array, emission: Array, table: Array) -> None:
    """Add `emission` (texels, 3) from `directions` (texels, 3) to `table` (CELLS, 3) for all normals."""
    frames, cos_diff, diff_bins = _half_frames(directions)
    for p in range(normals.shape[0]):
        nx, ny, nz = normals[p]
        for t in range(directions.shape[0]):
            cos_i = nx * directions[t, 0] + ny * directions[t, 1] + nz * directions[t, 2]
            if cos_i <= 0.0:
                continue
            cell = _cell_seen(nx, ny, nz, cos_i, frames[t], cos_diff[t], diff_bins[t])
            table[cell, 0] += emission[t, 0] * cos_i
            table[cell, 1] += emission[t, 1] * cos_i
            table[cell, 2] += emission[t, 2] * cos_i


def integrate_seen(
    light: EnvironmentMap, normals: Array, views: Array, visible: NDArray[np.bool_] | None
) -> Array:
    """As `integrate`, with a view for each pixel (pixels, 3), and which texels it sees (pixels, texels) or all."""
    emission = (light.radiance * light.solid_angles()[..., None]).reshape(-1, 3)
    shining = emission.any(axis=-1)
    seen = np.ones((1, np.count_nonzero(shining)), bool) if visible is None else visible[:, shining]
    table = np.zeros((CELLS, 3))
    _gather_seen(
        np.ascontiguousarray(normals),
        np.ascontiguousarray(views),
        np.ascontiguousarray(seen),
        light.directions().reshape(-1, 3)[shining],
        emission[shining],
        table,
    )
    return np.ascontiguousarray(table.T).reshape(3, *SHAPE) / len(normals)


@compiled.entry()
def _gather_seen(
    normals: Array, views: Array, seen: NDArray[np.bool_], directions: Array, emission: Array, table: Array
) -> None:
    """As `_gather`; `seen` (1 or pixels, texels)."""
    for p in range(normals.shape[0]):
        normal, view, sees = normals[p], views[p], seen[p % seen.shape[0]]
        for t in range(directions.shape[0]):
            w_i = directions[t]
            cos_i = normal[0] * w_i[0] + normal[1] * w_i[1] + normal[2] * w_i[2]
            if cos_i <= 0.0 or not sees[t]:
                continue
            cell = cell_of(normal, w_i, view, cos_i)
            table[cell, 0] += emission[t, 0] * cos_i
            table[cell, 1] += emission[t, 1] * cos_i
            table[cell, 2] += emission[t, 2] * cos_i


@njit
def _cell_seen(nx: float, ny: float, nz: float, cos_i: float, frame: Array, cos_diff: float, diff_bin: int) -> int:
    """The cell in which a pixel of normal (nx, ny, nz) sees a texel, given the texel's share of `_half_frames`."""
    cos_half = nx * frame[0] + ny * frame[1] + nz * frame[2]
    # w_i in the tangent frame at the half vector, both components times sin(theta_half).
    x = cos_diff * cos_half - cos_i
    y = nx * frame[3] + ny * frame[4] + nz * frame[5]
    return _cell(math.acos(min(cos_half, 1.0)), diff_bin, math.atan2(y, x))


@njit
def cell_of(normal: Array, w_i: Array, w_o: Array, cos_i: float) -> int:
    """The cell of unit directions about a normal, all (3,) in world space; cos_i = normal . w_i."""
    x, y, z = w_i[0] + w_o[0], w_i[1] + w_o[1], w_i[2] + w_o[2]
    length = max(math.sqrt(x * x + y * y + z * z), 1e-300)
    x, y, z = x / length, y / length, z / length
    cos_diff = 0.5 * length
    cos_half = normal[0] * x + normal[1] * y + normal[2] * z
    across = (
        normal[0] * (y * w_i[2] - z * w_i[1])
        + normal[1] * (z * w_i[0] - x * w_i[2])
        + normal[2] * (x * w_i[1] - y * w_i[0])
    )
    diff_bin = min(int(math.acos(min(cos_diff, 1.0)) / (math.pi / 2) * SHAPE[1]), SHAPE[1] - 1)
    theta_half = math.acos(max(min(cos_half, 1.0), 0.0))
    return _cell(theta_half, diff_bin, math.atan2(across, cos_diff * cos_half - cos_i))


@njit
def _half_frames(directions: Array) -> tuple[Array, Array, NDArray[np.int64]]:
    """What a texel shares among all pixels: half vector h and h x w_i (texels, 6), cos(theta_diff), bin."""
    count = directions.shape[0]
    frames, cos_diff, bins = np.zeros((count, 6)), np.zeros(count), np.zeros(count, np.int64)
    for t in range(count):
        lx, ly, lz = directions[t]
        length = math.sqrt(lx * lx + ly * ly + (lz + 1.0) ** 2)
        if length == 0.0:
            continue  # w_i = -w_o lies below every horizon
        hx, hy, hz = lx / length, ly / length, (lz + 1.0) / length
        frames[t] = (hx, hy, hz, hy * lz - hz * ly, hz * lx - hx * lz, hx * ly - hy * lx)
        cos_diff[t] = hz
        bins[t] = min(int(math.acos(min(hz, 1.0)) / (math.pi / 2) * SHAPE[1]), SHAPE[1] - 1)
    return frames, cos_diff, bins


@njit
def _cell(theta_half: float, diff_bin: int, phi_diff: float) -> int:
    """As `fitters.grid.cell_index`, the theta_diff bin given; phi_diff in [-pi, pi] is folded modulo pi."""
    half_bin = min(int(math.sqrt(theta_half / (math.pi / 2)) * SHAPE[0]), SHAPE[0] - 1)
    if phi_diff < 0.0:
        phi_diff += math.pi
    # Both 0 and pi belong to the first bin.
    phi_bin = int(phi_diff / math.pi * SHAPE[2]) % SHAPE[2]
    return (half_bin * SHAPE[1] + diff_bin) * SHAPE[2] + phi_bin
