"""G from D: Smith's shadowing of a tabulated distribution of normals, as a linear map.

The integrals of section 4.3 of Bagher et al. 2016 are linear in D, and so is its normalisation (eq. 19): with D
(90,) at the bins' centres, linear in between, Lambda at the nodes of G is (A D) / (n D), and G = 1 / (1 + Lambda).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fitters.grid import SHAPE, Array, bin_centres
from fitters.models.factors.samples import NODES

POINTS = 15
"""Of the Gauss-Legendre rule for each integral (section 4.3)."""


@dataclass(frozen=True, eq=False)
class Smith:
    """`lambdas` (90, 90) and `norm` (90,): A and n above."""

    lambdas: Array
    norm: Array

    def shadowing(self, ndf: Array) -> Array:
        """G (90,) at 0, 1, .. 89 degrees of a distribution (90,) of any scale."""
        return 1.0 / (1.0 + (self.lambdas @ ndf) / (self.norm @ ndf))

    def log_derivative(self, ndf: Array) -> tuple[Array, Array]:
        """G (90,), and d log G_k / d log D_m (90, 90)."""
        norm = float(self.norm @ ndf)
        ratio = (self.lambdas @ ndf) / norm
        g = 1.0 / (1.0 + ratio)
        slope = (self.lambdas - ratio[:, None] * self.norm) * (ndf / norm)
        return g, -g[:, None] * slope


@lru_cache(maxsize=4)
def smith(points: int = POINTS) -> Smith:
    """The map for a Gauss-Legendre rule of this number of points; more of them resolve sharper distributions."""
    x, weight = np.polynomial.legendre.leggauss(points)
    lambdas = np.zeros((NODES, SHAPE[0]))
    psi, psi_weight = (x + 1) * np.pi / 4, weight * np.pi / 4
    for node in range(1, NODES):
        theta = np.radians(node)
        mu = 1.0 / np.tan(theta)
        low = np.arctan(mu)
        omega, omega_weight = low + (x + 1) * (np.pi / 2 - low) / 2, weight * (np.pi / 2 - low) / 2
        outer = omega_weight * (np.tan(omega) - mu) * (1 + np.tan(omega) ** 2) / mu
        # p_2 at tan(omega): the slopes across the plane of incidence integrated out
        squared = np.tan(omega)[:, None] ** 2 + np.tan(psi)[None, :] ** 2
        theta_half = np.arctan(np.sqrt(squared))
        inner = 2 * psi_weight * (np.tan(psi) ** 2 + 1) * np.cos(theta_half) ** 4
        lambdas[node] = _interpolation(theta_half, outer[:, None] * inner)
    return Smith(lambdas, _norm())


def _interpolation(theta: Array, weights: Array) -> Array:
    """Coefficients (90,) of D in the weighted sum of its values at `theta`.

    D is constant before the first centre and beyond the last but one: no sample sees the last bin, from 88 degrees
    on, and what only G depends on would be free.
    """
    centres = bin_centres()[0]
    position = np.interp(theta.ravel(), centres[:-1], np.arange(SHAPE[0] - 1))
    low = np.minimum(position.astype(int), SHAPE[0] - 3)
    part, flat = position - low, weights.ravel()
    coefficients = np.zeros(SHAPE[0])
    np.add.at(coefficients, low, flat * (1 - part))
    np.add.at(coefficients, low + 1, flat * part)
    return coefficients


def _norm() -> Array:
    """Eq. 19 as coefficients (90,) of D: a rule of two points between any two neighbouring centres."""
    edges = np.concatenate([[0.0], bin_centres()[0], [np.pi / 2]])
    x, weight = np.polynomial.legendre.leggauss(2)
    half = np.diff(edges) / 2
    theta = (edges[:-1] + half)[:, None] + half[:, None] * x
    return _interpolation(theta, 2 * np.pi * half[:, None] * weight * np.cos(theta) * np.sin(theta))
