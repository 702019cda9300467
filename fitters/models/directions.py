"""Directions as models take them: of any float type and layout, and perhaps none at all."""

import numpy as np
from numpy.typing import NDArray

from fitters.grid import Array


def rows(vectors: Array) -> Array:
    """Vectors (n, 3) as contiguous float64, which compiled code and narrow highlights need."""
    return np.ascontiguousarray(vectors, np.float64)


def both_above(w_i: Array, w_o: Array) -> NDArray[np.bool_]:
    """(n,): both directions above the horizon; not so where a component is NaN or infinite."""
    return (w_i[:, 2] > 0) & (w_o[:, 2] > 0) & np.isfinite(w_i + w_o).all(axis=1)
