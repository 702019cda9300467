"""Beckmann's and GGX's parameters with the moments of a slope density, appendix C.

Of the printed Beckmann formulas the factor stands on the wrong side: its density has E[x^2] = alpha_x^2 / 2, so
that alpha_x^2 = 2 E[x^2]. GGX has E|x| = alpha_x.
"""

import numpy as np

from fitters.grid import Array
from fitters.models.power_iterations.anisotropic import azimuths
from fitters.models.power_iterations.slopes import Slopes, mean_square, quadrature

Alphas = tuple[float, float, float]


def isotropic_alphas(density: Slopes) -> tuple[float, float]:
    """Beckmann's and GGX's alpha of one normalised density: E[x^2] = E[r^2] / 2 and E|x| = 2 / pi E[r]."""
    tangent, weight = quadrature(density)
    return float(np.sqrt(mean_square(density))), float(2 / np.pi * (tangent @ weight))


def tail_share(density: Slopes) -> float:
    """The share of E[r^2] beyond the last node, where P is an assumption."""
    tangent, weight = quadrature(density)
    inner = 4 * (len(density.t) - 1)
    # Of one density or of the mean over columns.
    return float(1 - np.sum(weight[..., :inner] @ tangent[:inner] ** 2) / np.sum(mean_square(density)))


def anisotropic_alphas(density: Slopes) -> tuple[Alphas, Alphas]:
    """Beckmann's and GGX's (alpha_x, alpha_y, rho) of a normalised density with a column per azimuth."""
    columns = len(density.log_p)
    phi = azimuths(columns)
    x, y = np.cos(phi), np.sin(phi)
    tangent, weight = quadrature(density)
    square, length = mean_square(density) / columns, weight @ tangent / columns
    beckmann_x, beckmann_y = np.sqrt(2 * (square @ x**2)), np.sqrt(2 * (square @ y**2))
    beckmann = (beckmann_x, beckmann_y, 2 * (square @ (x * y)) / (beckmann_x * beckmann_y))
    ggx_x, ggx_y = length @ np.abs(x), length @ np.abs(y)
    mass = density.total / columns
    beta_1, beta_2 = mass @ (x * y), mass @ y**2
    ggx = (ggx_x, ggx_y, ggx_y / ggx_x * beta_1 / (beta_1**2 + beta_2**2))
    return _alphas(*beckmann), _alphas(*ggx)


def _alphas(alpha_x: Array, alpha_y: Array, rho: Array) -> Alphas:
    """As floats; noise must not take rho out of the open interval (-1, 1)."""
    return float(alpha_x), float(alpha_y), float(np.clip(rho, -1 + 1e-9, 1 - 1e-9))
