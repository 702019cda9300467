"""Colours of light in 32 bits: three mantissas of nine bits and one exponent (R9G9B9E5 of OpenGL and Direct3D).

Channels are kept to one part in 512 of the largest, over twelve decades of light.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fitters.grid import Array

LARGEST = 65408.0
"""The largest value that the format holds, 511 / 512 2^16."""

STEPS = 2.0 ** (np.arange(32) - 24.0)
"""By exponent, the value of one unit of a mantissa."""


@njit
def packed_row(colours: Array, at: NDArray[np.int32], words: NDArray[np.uint32]) -> float:
    """Writes colours (n, 3) at indices (k,) to `words` (k,), and returns the factor that scales them back."""
    peak = 0.0
    for index in at:
        peak = max(peak, colours[index, 0], colours[index, 1], colours[index, 2])
    if peak == 0.0:
        words[:] = 0
        return 0.0
    scale = peak / LARGEST
    for k in range(len(at)):
        words[k] = _packed(colours[at[k]], 1.0 / scale)
    return scale


@njit
def _packed(colour: Array, scale: float) -> int:
    red, green, blue = colour[0] * scale, colour[1] * scale, colour[2] * scale
    # 9 bits below the leading one, 2^-24 being the smallest step; rounding up may carry into the exponent.
    exponent = max(math.frexp(max(red, green, blue))[1], -15)
    if math.floor(math.ldexp(max(red, green, blue), 9 - exponent) + 0.5) == 512.0:
        exponent += 1
    step = math.ldexp(1.0, exponent - 9)
    mantissas = int(red / step + 0.5) | int(green / step + 0.5) << 9 | int(blue / step + 0.5) << 18
    return mantissas | (exponent + 15) << 27


def unpacked(words: NDArray[np.uint32], scale: float) -> Array:
    """Colours (n, 3) of packed ones (n,)."""
    mantissas = np.stack([words & 511, words >> 9 & 511, words >> 18 & 511], axis=-1)
    return mantissas * (STEPS[words >> 27] * scale)[:, None]
