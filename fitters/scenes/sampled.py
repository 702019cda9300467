"""The light table of any geometry by sampling, until two halves of the samples agree.

At every point of the surface two kinds of directions are drawn: light directions by the energy of the map, which
find small bright windows, and half vectors around the normal, which resolve the narrow bins there. Each sample is
weighted by the density of both together (the balance heuristic of Veach 1997), so that the table has no bias.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from fitters import compiled
from fitters.grid import CELLS, SHAPE, Array
from fitters.scenes.cells import cell_of, frame_about, texel_of
from fitters.scenes.environment import EnvironmentMap
from fitters.scenes.geometry import Geometry

TOLERANCE = 0.05
"""A table has converged at this relative L2 distance from its limit, estimated from two halves of the samples."""
ROUNDS = 7
"""The number of samples is doubled at most this many times."""
LIGHT_SAMPLES = 128
"""Light directions per point of the surface, in each pass over all points."""
HALF_SAMPLES = np.array([2] * 16 + [1] * 16 + [0] * 58)
"""Half vectors per point and pass in each bin of theta_half."""
GOLDEN, PLANE = 0.6180339887498949, (0.7548776662466927, 0.5698402909980532)
"""Steps of the sequences that fill a line and a plane most evenly (Roberts 2018)."""
POOL = 1 << 20
"""The number of light directions to choose from, drawn once by the energy of the map."""


@dataclass(frozen=True, eq=False)
class _Light:
    """Directions drawn by energy, and the map itself for other directions.

    directions: (m, 3), with `radiance` (m, 3), `density` (m,) in sr^-1 and `seen_as` (m,), their texels in the
                reduced map for which visibility is known
    texels:     (rows x 2 rows, 3) radiance of the map, with `texel_density` (rows x 2 rows,) in sr^-1
    """

    directions: Array
    radiance: Array
    density: Array
    seen_as: NDArray[np.int64]
    texels: Array
    texel_density: Array
    rows: int


def sampled_table(
    light: EnvironmentMap, points: Geometry, image: Geometry, light_rows: int, *, tolerance: float = TOLERANCE
) -> tuple[Array, float]:
    """Light through each cell (3, 90, 90, 180), and its relative L2 distance from the limit (largest of channels).

    The mean is over `points`, an image of the surface that may be finer than `image`. Each point sees the same
    texels, of `light_rows` x 2 `light_rows`, as the nearest pixel of `image`. The distance is half that of two
    tables, each made from half of the points; after `ROUNDS` it may still be above `tolerance`.
    """
    drawn = _drawn(light, light_rows)
    visible = np.ones((1, 1), bool) if image.visible is None else image.visible
    places = np.zeros(len(points.pixels), np.int64) if image.visible is None else _nearest(points, image)

    def batch(seed: int) -> Array:
        table, shifts, half = np.zeros((CELLS, 3)), np.random.default_rng(seed).random(3), slice(seed % 2, None, 2)
        normals, views = (np.ascontiguousarray(of[half]) for of in (points.normals, points.views))
        _gather(
            normals, views, visible, places[half].copy(), drawn.directions, drawn.radiance, drawn.density,
            drawn.seen_as, drawn.texels, drawn.texel_density, drawn.rows, light_rows, LIGHT_SAMPLES, HALF_SAMPLES,
            shifts, table,
        )  # fmt: skip
        return table / max(len(normals), 1)

    halves, rounds, distance = np.zeros((2, CELLS, 3)), 0, np.inf
    with ThreadPoolExecutor(2) as pool:
        while distance > tolerance and rounds < 1 << ROUNDS:
            for seed in range(rounds, max(2 * rounds, 1)):
                # Added up in a fixed order, whichever is finished first.
                for half, table in enumerate(pool.map(batch, (2 * seed, 2 * seed + 1))):
                    halves[half] += table
            rounds = max(2 * rounds, 1)
            distance = _distance(halves)
    return np.ascontiguousarray(halves.sum(axis=0).T).reshape(3, *SHAPE) / (2 * rounds), distance


def _distance(halves: Array) -> float:
    """Relative L2 distance of the mean of two tables (2, cells, 3) from their limit, the largest of the channels.

    Their errors are independent, so that the mean is half their difference away from the limit; the squared length
    of the limit is the smaller by that.
    """
    apart = np.sum((halves[0] - halves[1]) ** 2, axis=0)
    limit = np.sum((halves[0] + halves[1]) ** 2, axis=0) - apart
    return float(np.sqrt(np.max(np.divide(apart, limit, out=np.where(apart > 0, np.inf, 0.0), where=limit > 0))))


def _nearest(points: Geometry, image: Geometry) -> NDArray[np.int64]:
    """For every point of a finer image the index (n,) of the nearest pixel of a coarser one."""

    def middles(of: Geometry) -> Array:
        return (np.stack(np.divmod(of.pixels, of.shape[1]), axis=1) + 0.5) / of.shape

    return KDTree(middles(image)).query(middles(points))[1]


def _drawn(light: EnvironmentMap, light_rows: int) -> _Light:
    """`POOL` directions in strata of equal energy, with their densities."""
    rng = np.random.default_rng(0)
    energy = light.radiance.sum(axis=-1)
    per_texel = (energy * light.solid_angles()).ravel()
    cumulative = np.cumsum(per_texel)
    places = (np.arange(POOL) + rng.random(POOL)) / POOL * cumulative[-1]
    at = np.minimum(np.searchsorted(cumulative, places, side="right"), len(cumulative) - 1)
    rows, columns = np.divmod(at, 2 * light.rows)
    edges = np.cos(np.arange(light.rows + 1) / light.rows * np.pi)
    y = edges[rows] + (edges[rows + 1] - edges[rows]) * rng.random(POOL)
    phi = (columns + rng.random(POOL)) / light.rows * np.pi
    across = np.sqrt(1 - y**2)
    density = (energy / per_texel.sum()).ravel()
    seen_row = np.minimum((np.arccos(y) / np.pi * light_rows).astype(np.int64), light_rows - 1)
    seen_column = np.minimum((phi / np.pi * light_rows).astype(np.int64), 2 * light_rows - 1)
    return _Light(
        directions=np.stack([across * np.sin(phi), y, -across * np.cos(phi)], axis=-1),
        radiance=light.radiance.reshape(-1, 3)[at],
        density=density[at],
        seen_as=seen_row * 2 * light_rows + seen_column,
        texels=light.radiance.reshape(-1, 3),
        texel_density=density,
        rows=light.rows,
    )


@compiled.entry(nogil=True)
def _gather(
    normals: Array,
    views: Array,
    visible: NDArray[np.bool_],
    places: NDArray[np.int64],
    directions: Array,
    radiance: Array,
    density: Array,
    seen_as: NDArray[np.int64],
    texels: Array,
    texel_density: Array,
    rows: int,
    light_rows: int,
    light_samples: int,
    half_samples: NDArray[np.int64],
    shifts: Array,
    table: Array,
) -> None:
    """Adds the light on all points to `table` (CELLS, 3); `visible` is (places, texels), or (1, 1) for all light.

    Samples follow the sequences of the golden ratio (Roberts 2018), shifted at random by `shifts` (3,).
    """
    everything = visible.shape[1] == 1
    stride = len(directions) // light_samples
    edges = np.cos((np.arange(SHAPE[0] + 1) / SHAPE[0]) ** 2 * (np.pi / 2))
    for p in range(len(normals)):
        normal, view, sees = normals[p], views[p], visible[places[p]]
        offset = int((shifts[0] + p * PLANE[0]) % 1.0 * stride)
        for k in range(light_samples):
            at = offset + k * stride
            w_i = directions[at]
            cos_i = normal[0] * w_i[0] + normal[1] * w_i[1] + normal[2] * w_i[2]
            if cos_i <= 0.0 or not (everything or sees[seen_as[at]]):
                continue
            cell = cell_of(normal, w_i, view, cos_i)
            half_bin = cell // (SHAPE[1] * SHAPE[2])
            cos_diff = np.sqrt(0.5 + 0.5 * (w_i[0] * view[0] + w_i[1] * view[1] + w_i[2] * view[2]))
            share = half_samples[half_bin] / (2 * np.pi * (edges[half_bin] - edges[half_bin + 1]) * 4 * cos_diff)
            weight = cos_i / (light_samples * density[at] + share)
            for c in range(3):
                table[cell, c] += radiance[at, c] * weight
        first, second = frame_about(normal)
        for half_bin in range(SHAPE[0]):
            count = half_samples[half_bin]
            for k in range(count):
                phi = (k + (shifts[1] + p * PLANE[1] + half_bin * GOLDEN) % 1.0) / count * 2 * np.pi
                inside = (shifts[2] + (p * SHAPE[0] + half_bin + k / count) * GOLDEN) % 1.0
                cos_half = edges[half_bin] + (edges[half_bin + 1] - edges[half_bin]) * inside
                sin_half = np.sqrt(max(1 - cos_half**2, 0.0))
                half = sin_half * np.cos(phi) * first + sin_half * np.sin(phi) * second + cos_half * normal
                cos_diff = half[0] * view[0] + half[1] * view[1] + half[2] * view[2]
                w_i = 2 * cos_diff * half - view
                cos_i = normal[0] * w_i[0] + normal[1] * w_i[1] + normal[2] * w_i[2]
                if cos_diff <= 0.0 or cos_i <= 0.0:
                    continue
                if not (everything or sees[texel_of(w_i, light_rows)]):
                    continue
                texel = texel_of(w_i, rows)
                cell = cell_of(normal, w_i, view, cos_i)
                share = count / (2 * np.pi * (edges[half_bin] - edges[half_bin + 1]) * 4 * cos_diff)
                weight = cos_i / (light_samples * texel_density[texel] + share)
                for c in range(3):
                    table[cell, c] += texels[texel, c] * weight
