"""An environment map at all resolutions: each level has half the rows of the one below it, and the same energy."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.grid import Array
from fitters.scenes.environment import EnvironmentMap

COARSEST = (8, 64)
"""Rows of the first level: as few as halving exactly leads to within these."""
FINEST = 1024
"""Rows of the last level at most: texels of 0.18 degrees."""


@dataclass(frozen=True, eq=False)
class Pyramid:
    """Levels from the coarsest map to the finest.

    texels:  (n, 3) radiance, level by level, row by row
    centres: (n, 3) unit directions to the middle of the light that a texel holds
    rows:    (levels,) of each level, doubling
    starts:  (levels,) where the texels of each level begin
    """

    texels: Array
    centres: Array
    rows: NDArray[np.int64]
    starts: NDArray[np.int64]


def pyramid(light: EnvironmentMap) -> Pyramid:
    """The pyramid of a map; its finest level is the map, or, where that cannot be halved often enough or is very
    large, as near to it as a power of two comes.
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
    """By level the directions (texels, 3) to the middle of every texel's light, of all channels together."""
    finest = levels[-1]
    energy = finest.radiance.sum(axis=-1) * finest.solid_angles()
    # Dark texels have a middle, too.
    moment = (energy + 1e-9 * energy.max())[..., None] * finest.directions()
    moments = [moment]
    for level in levels[-2::-1]:
        moments.insert(0, moments[0].reshape(level.rows, 2, 2 * level.rows, 2, 3).sum(axis=(1, 3)))
    return [(m / np.linalg.norm(m, axis=-1, keepdims=True)).reshape(-1, 3) for m in moments]


def _halvings(rows: int) -> list[int]:
    """Rows of the levels down to these, rising."""
    found = [rows]
    while found[0] % 2 == 0 and found[0] // 2 >= COARSEST[0]:
        found.insert(0, found[0] // 2)
    return found
