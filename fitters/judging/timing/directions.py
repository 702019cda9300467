"""Pairs of directions to call models at."""

import math

import numpy as np

from fitters.grid import Array

COUNT = 1 << 17
"""So many that incoherent ones reach all over the measured table, and that a pass of any model warms up in it."""


def incoherent(count: int = COUNT) -> tuple[Array, Array]:
    """Unit w_i and w_o (count, 3), each uniform over the hemisphere, in random order.

    What a path tracer asks after a few bounces: no two calls in a row read the same cell of a table.
    """
    w = np.random.default_rng(0).normal(size=(2, count, 3))
    w[..., 2] = np.abs(w[..., 2])
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    return w[0], w[1]


def coherent(count: int = COUNT) -> tuple[Array, Array]:
    """About `count` pairs: the lit pixels of a sphere seen from far away, lamp at 45 degrees, row by row.

    What a rasteriser asks: neighbours read the same cells, or cells that the cache has just seen.
    """
    # The lit part of the disc is so large a share of the square around it.
    side = math.ceil(math.sqrt(count / (math.pi / 8 * (1 + math.cos(math.pi / 4)))))
    row = (np.arange(side) + 0.5) / side * 2 - 1
    y, x = (axis.ravel() for axis in np.meshgrid(row, row, indexing="ij"))
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0.0))
    lamp = np.array([0.0, math.sqrt(0.5), math.sqrt(0.5)])
    normal = np.stack([x, y, z], axis=-1)[(z > 0) & (lamp[1] * y + lamp[2] * z > 0)]
    # The frame at a pixel: its x axis lies in the plane of y and the normal's z, whatever turns it matters little.
    tangent = np.stack([normal[:, 2], np.zeros(len(normal)), -normal[:, 0]], axis=-1)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=1)
    return np.ascontiguousarray(frame @ lamp), np.ascontiguousarray(frame[:, :, 2])
