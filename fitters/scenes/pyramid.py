"""An environment map at all resolutions: each level has half the rows of the one below it, and the same energy."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.grid import Array
from fitters.scenes.environment import EnvironmentMap

COARSEST, FINEST = 8, 1024
"""Rows of the first level, and of the last at most: texels of 0.18 degrees."""


@dataclass(frozen=True, eq=False)
class Pyramid:
    """Levels from the coarsest map to the finest.

    texels: (n, 3) radiance, level by level, row by row
    rows:   (levels,) of each level, doubling
    starts: (levels,) where the texels of each level begin
    """

    texels: Array
    rows: NDArray[np.int64]
    starts: NDArray[np.int64]


def pyramid(light: EnvironmentMap) -> Pyramid:
    """The pyramid of a map; its finest level has at least the map's rows, as far as `FINEST` allows."""
    finest = COARSEST
    while finest < min(light.rows, FINEST):
        finest *= 2
    levels = [light.reduced(finest)]
    while levels[-1].rows > COARSEST:
        levels.append(levels[-1].reduced(levels[-1].rows // 2))
    levels.reverse()
    rows = np.array([level.rows for level in levels])
    starts = np.concatenate([[0], np.cumsum(2 * rows**2)[:-1]])
    return Pyramid(np.concatenate([level.radiance.reshape(-1, 3) for level in levels]), rows, starts)
