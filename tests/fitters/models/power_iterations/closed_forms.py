"""Beckmann and GGX in closed form (Walter et al. 2007, Heitz 2014), anisotropic, and materials made of them."""

import numpy as np
from scipy.special import erf

from fitters.grid import SHAPE, cell_directions
from fitters.materials.material import from_samples


def direction(theta, phi=0.0):
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


class Surface:
    """Slopes with scale matrix Sigma, eq. 9 and appendix C, turned by an angle."""

    def __init__(self, kind, alpha_1, alpha_2=None, turn=0.0, fresnel=(1.0, 1.0, 1.0)):
        turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        self.sigma = turned @ np.diag([alpha_1**2, (alpha_2 or alpha_1) ** 2]) @ turned.T
        self.inverse, self.root = np.linalg.inv(self.sigma), np.sqrt(np.linalg.det(self.sigma))
        self.kind, self.fresnel = kind, np.array(fresnel)

    @property
    def alphas(self):
        x, y = np.sqrt(np.diag(self.sigma))
        return x, y, self.sigma[0, 1] / (x * y)

    def slope_pdf(self, x, y):
        q = self.inverse[0, 0] * x * x + 2 * self.inverse[0, 1] * x * y + self.inverse[1, 1] * y * y
        return np.exp(-q) / (np.pi * self.root) if self.kind == "beckmann" else (1 + q) ** -2 / (np.pi * self.root)

    def ndf(self, h):
        return self.slope_pdf(-h[..., 0] / h[..., 2], -h[..., 1] / h[..., 2]) / h[..., 2] ** 4

    def shadowing(self, w):
        """Smith's G1."""
        (xx, xy), (_, yy) = self.sigma
        steep = np.sqrt(xx * w[..., 0] ** 2 + 2 * xy * w[..., 0] * w[..., 1] + yy * w[..., 1] ** 2) / w[..., 2]
        steep = np.maximum(steep, 1e-9)
        if self.kind == "ggx":
            return 2 / (1 + np.sqrt(1 + steep**2))
        a = 1 / steep
        return 2 / (1 + erf(a) + np.exp(-a * a) / (a * np.sqrt(np.pi)))

    def brdf(self, w_i, w_o):
        """Eq. 1 with eq. 2, (n, 3) above the horizon; where light and view coincide eq. 12."""
        half = w_i + w_o
        half = half / np.linalg.norm(half, axis=-1, keepdims=True)
        g_i, g_o = self.shadowing(w_i), self.shadowing(w_o)
        both = np.where(np.all(w_i == w_o, axis=-1), g_o, g_i * g_o / (g_i + g_o - g_i * g_o))
        return (self.ndf(half) * both / (4 * w_i[..., 2] * w_o[..., 2]))[..., None] * self.fresnel


def material(brdf, name="closed form"):
    """A table of a BRDF (n, 3) of directions (n, 3)."""
    w_i, w_o = cell_directions()
    above = (w_i[:, 2] > 0) & (w_o[:, 2] > 0)
    samples = np.full((3, len(w_i)), np.nan)
    samples[:, above] = brdf(w_i[above], w_o[above]).T
    return from_samples(name, samples.reshape(3, *SHAPE), source="test", sha256=name)


def random_directions(count, seed, least_cos=0.05):
    random = np.random.default_rng(seed)
    return direction(np.arccos(random.uniform(least_cos, 1, count)), random.uniform(0, 2 * np.pi, count))
