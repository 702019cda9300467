"""Anisotropic extraction: the slope density over (phi, theta) as the eigenvector of eq. 18.

o.h / (cos_o cos_h) = 1 + tan_o tan_h cos(phi_o - phi_h): over even azimuths the kernel is a convolution, so that a
product with the matrix of eq. 17 is one small matrix product per harmonic, and the matrix is never laid out.
"""

import numpy as np

from fitters.grid import Array
from fitters.models.power_iterations.isotropic import Eigenvector, nodes
from fitters.models.power_iterations.slopes import Slopes, quadrature, slopes


def azimuths(count: int) -> Array:
    """Azimuths (count,) of the tables' columns, from 0."""
    return np.arange(count) / count * 2 * np.pi


class Facing:
    """The mean over phi_h of max(0, 1 + tan_o tan_h cos(phi_o - phi_h)) times a table: sums over slopes.

    `tan_o` (m,) and `tan_h` (q,); `count` even azimuths.
    """

    def __init__(self, tan_o: Array, tan_h: Array, count: int):
        product = np.outer(tan_o, tan_h)[..., None] * np.cos(azimuths(count))
        # Real and even, so its harmonics are real too: (harmonics, m, q).
        harmonics = np.fft.rfft(np.maximum(1 + product, 0.0)).real / count
        self._harmonics = np.ascontiguousarray(np.moveaxis(harmonics, -1, 0))
        self._count = count

    def __call__(self, table: Array) -> Array:
        """Sums (count, m) for a table (count, q)."""
        given = np.fft.rfft(table, axis=0)
        sums = self._harmonics @ given.real[..., None] + 1j * (self._harmonics @ given.imag[..., None])
        return np.fft.irfft(sums[..., 0], self._count, axis=0)


def dominant(backscattering: Array, iterations: int, tolerance: float) -> Eigenvector:
    """The Perron eigenvector (phi, theta) for f_r(o, o) (phi, theta) at `azimuths` and `isotropic.nodes`."""
    columns, count = backscattering.shape
    theta = nodes(count)
    tangent, cosine = np.tan(theta), np.cos(theta)
    ring = 2 * np.pi * tangent / cosine**2 * np.sqrt(theta * 2 * np.pi) / count
    rows = 4 * backscattering * cosine**6
    facing = Facing(tangent, tangent, columns)
    p, change, done = np.ones_like(rows), np.inf, 0
    while done < iterations and change > tolerance:
        # The transform's rounding must not make a mean negative that is at least the share facing o.
        following = rows * np.maximum(facing(p * ring), 0.0)
        following /= following.max()
        change = float(np.max(np.abs(following - p) / np.maximum(following, 1e-300)))
        p, done = following, done + 1
    return Eigenvector(p, done, change)


def slope_pdf(backscattering: Array, iterations: int = 200, tolerance: float = 1e-12) -> tuple[Array, Eigenvector]:
    """P (phi, theta), eq. 8 holding, and the eigenvector that it is."""
    eigenvector = dominant(backscattering, iterations, tolerance)
    return eigenvector.values / slopes(
        nodes(backscattering.shape[1]), eigenvector.values
    ).total.mean(), eigenvector


def projected_area(density: Slopes, cos_theta: Array) -> Array:
    """sigma (phi, m) of a density with a column per azimuth at m cosines in (0, 1]."""
    tangent, weight = quadrature(density)
    tan_o = np.sqrt(1 - cos_theta**2) / cos_theta
    return np.maximum(cos_theta * Facing(tan_o, tangent, len(weight))(weight), cos_theta)
