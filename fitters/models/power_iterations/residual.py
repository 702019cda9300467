"""How much of a material its microfacet model does not explain: what tells that the method was the wrong one."""

import numpy as np
from numpy.typing import NDArray

from fitters.grid import CELLS, SHAPE, Array, bin_centres, cell_directions
from fitters.materials import Material
from fitters.models.model import Model

STRIDES = (3, 3, 12)
"""Of theta_half, theta_diff and phi_diff: some ten thousand cells."""


def residual(material: Material, model: Model) -> float:
    """Sum of |f - m| over sum of m, both weighted by cosines and the cells' volume (Bagher et al. 2016, eq. 9)."""
    chosen = _chosen() & material.valid.ravel()
    w_i, w_o = (w[chosen] for w in cell_directions())
    weights = (_volume()[chosen] * w_i[:, 2] * w_o[:, 2])[:, None]
    measured = material.table.reshape(3, CELLS)[:, chosen].T
    total = float(np.sum(weights * measured))
    return float(np.sum(weights * np.abs(model.evaluate(w_i, w_o) - measured))) / total if total > 0 else 0.0


def _chosen() -> NDArray[np.bool_]:
    chosen = np.zeros(SHAPE, np.bool_)
    chosen[tuple(slice(stride // 2, None, stride) for stride in STRIDES)] = True
    return chosen.ravel()


def _volume() -> Array:
    """(CELLS,): sqrt(8 sin^2 (cos^2 + sin^2 cos^2 phi_diff)) of theta_diff, times the step of theta_half."""
    theta_half, theta_diff, phi_diff = bin_centres()
    sin2 = np.sin(theta_diff)[:, None] ** 2
    form = np.sqrt(8 * sin2 * (1 - sin2 + sin2 * np.cos(phi_diff) ** 2))
    return (np.sqrt(theta_half)[:, None, None] * form).ravel()
