"""What both models require of their tables: compiled look-ups do not check where they read."""

import numpy as np

from fitters.errors import FittersError
from fitters.grid import Array

Tables = tuple[Array, Array, Array, Array, Array]


def checked(theta: Array, p: Array, theta_k: Array, g1: Array, fresnel: Array, *, axes: int) -> Tables:
    """The tables as contiguous float64: `theta` (n,), P (.., n), `theta_k` (m,), G1 (.., m), F (k, 3).

    P and G1 have `axes` axes. Raises `FittersError` where shapes disagree or values are negative or not finite.
    """
    given = (theta, p, theta_k, g1, fresnel)
    nodes, density, area_nodes, shadowing, table = (np.ascontiguousarray(x, np.float64) for x in given)
    fits = (
        nodes.ndim == area_nodes.ndim == 1
        and density.ndim == shadowing.ndim == axes
        and density.shape[-1:] == nodes.shape
        and shadowing.shape[-1:] == area_nodes.shape
        and density.shape[:-1] == shadowing.shape[:-1]
        and table.shape == (len(table), 3)
        and min(len(nodes), len(area_nodes), len(table)) >= 2
    )
    if not fits:
        shapes = ", ".join(str(np.shape(x)) for x in given)
        raise FittersError(f"theta, P, theta_k, G1 and F do not fit each other: {shapes}")
    for name, values in zip(
        ("theta", "P", "theta_k", "G1", "F"), (nodes, density, area_nodes, shadowing, table), strict=True
    ):
        if not np.all((values >= 0) & np.isfinite(values)):
            raise FittersError(f"{name} holds values that are negative or not finite")
    return nodes, density, area_nodes, shadowing, table
