"""Isotropic extraction: the slope density as the eigenvector of eq. 24, and the projected area behind G1."""

from typing import NamedTuple

import numpy as np

from fitters.grid import Array
from fitters.models.power_iterations.slopes import Slopes, clamped_mean, quadrature, slopes


class Eigenvector(NamedTuple):
    """`values` (...), the largest 1; the iterations that led to it, and by how much the last changed it."""

    values: Array
    iterations: int
    change: float


def nodes(count: int) -> Array:
    """Elevations (count,) at the middle of equal steps of sqrt(theta): for 90, where MERL's bins have theirs."""
    return ((np.arange(count) + 0.5) / count) ** 2 * (np.pi / 2)


def area_nodes(count: int) -> Array:
    """Cosines (count,) of the elevations at which G1 is tabulated: even in sqrt(cos), dense where G1 falls."""
    return (np.arange(1, count + 1) / count) ** 2


def kernel(backscattering: Array) -> Array:
    """K' (n, n) of eq. 23 times the weights: f_r (n,) at `nodes(n)`, the azimuth integrated in closed form."""
    count = len(backscattering)
    theta = nodes(count)
    tangent, cosine = np.tan(theta), np.cos(theta)
    # d theta = pi u du for theta = u^2 pi / 2, and sec^4 cos_h sin_h d theta_h = tan sec^2 d theta_h.
    ring = 2 * np.pi * tangent / cosine**2 * np.sqrt(theta * 2 * np.pi) / count
    return (4 * backscattering * cosine**6)[:, None] * clamped_mean(np.outer(tangent, tangent)) * ring


def dominant(matrix: Array, iterations: int, tolerance: float) -> Eigenvector:
    """The Perron eigenvector of a matrix (n, n) without negative entries, from ones; algorithm 3."""
    p, change, done = np.ones(len(matrix)), np.inf, 0
    while done < iterations and change > tolerance:
        following = matrix @ p
        following /= following.max()
        change = float(np.max(np.abs(following - p) / np.maximum(following, 1e-300)))
        p, done = following, done + 1
    return Eigenvector(p, done, change)


def slope_pdf(backscattering: Array, iterations: int = 200, tolerance: float = 1e-12) -> tuple[Array, Eigenvector]:
    """P (n,) at `nodes(n)`, eq. 8 holding, for f_r(o, o) (n,) in any unit, and the eigenvector that it is."""
    eigenvector = dominant(kernel(backscattering), iterations, tolerance)
    return eigenvector.values / slopes(nodes(len(backscattering)), eigenvector.values).total, eigenvector


def projected_area(density: Slopes, cos_theta: Array) -> Array:
    """sigma (m,) = cos(theta) / G1(theta), eq. 3, of one normalised density at m cosines in [0, 1]."""
    tangent, weight = quadrature(density)
    sine = np.sqrt(1 - cos_theta**2)
    grazing = cos_theta < 1e-9
    product = np.outer(sine / np.where(grazing, 1.0, cos_theta), tangent)
    area = np.where(grazing, tangent @ weight / np.pi, cos_theta * (clamped_mean(product) @ weight))
    return np.maximum(area, cos_theta)
