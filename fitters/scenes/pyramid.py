"""An environment map at several resolutions, each with twice the rows of the one before and the same energy."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.grid import Array
from fitters.scenes.environment import EnvironmentMap

COARSEST = (8, 64)
"""Rows of the first level lie between these: the smallest number that exact halving reaches."""
FINEST = 1024
"""The largest number of rows of the last level: texels of 0.18 degrees."""


@dataclass(frozen=True, eq=False)
class Pyramid:
    """Levels from the coarsest map to the finest.

    texels:  (n, 3) radiance, level by level, row by row
    centres: (n, 3) unit directions to the centre of the light in a texel
    rows:    (levels,) of each level, doubling
    starts:  (levels,) where the texels of each level begin
    """

    texels: Array
    centres: Array
    rows: NDArray[np.int64]
    starts: NDArray[np.int64]


def pyramid(light: EnvironmentMap) -> Pyramid:
    """The pyramid of a map.

    Its finest level is the map itself, or, if the map is very large or cannot be halved often enough, the map at a
    power of two rows.
    """
    rows = _halvings(light.rows)
    if rows[0] > COARSEST[1] or rows[-1] > FINEST:
        rows = _halvings(min(2 ** int(np.ceil(np.log2(light.rows))), FINEST))
    levels = [light.reduced(rows[-1])]
    for fewer in rows[-2::-1]:
        levels.insert(0, levels[0].reduced(fewer))
    starts = np.concatenate([[0], np.cumsum(2 * np.square(rows)[:-1])])
    texels = np.concatenate([level.radiance.reshape(-1, 3) for level in levels])
    return Pyramid(texels, np.concatenate(_centres(levels)), np.array(rows), starts)


def _centres(levels: list[EnvironmentMap]) -> list[Array]:
    """By level the directions (texels, 3) to the centre of every texel's light, the sum of all channels."""
    finest = levels[-1]
    energy = finest.radiance.sum(axis=-1) * finest.solid_angles()
    # Dark texels need a centre, too.
    moment = (energy + 1e-9 * energy.max())[..., None] * finest.directions()
    moments = [moment]
    for level in levels[-2::-1]:
        moments.insert(0, moments[0].reshape(level.rows, 2, 2 * level.rows, 2, 3).sum(axis=(1, 3)))
    return [(m / np.linalg.norm(m, axis=-1, keepdims=True)).reshape(-1, 3) for m in moments]


def _halvings(rows: int) -> list[int]:
    """Rows of the levels up to this number, rising."""
    levels = [rows]
    while levels[0] % 2 == 0 and levels[0] // 2 >= COARSEST[0]:
        levels.insert(0, levels[0] // 2)
    return levels
