"""Directions sampled for any isotropic model: a tabulated distribution of half vectors, mixed with a cosine lobe.

Over theta_half the distribution follows the model's own highlight, as Walter et al. 2007 (section 5.2) do with
a formula's; what reflects without a highlight is left to the cosine lobe.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from fitters.grid import Array, directions

BINS = 90
LEAST_SHARE = 0.1
"""Neither of the two ways of sampling is chosen more rarely than this."""

_EDGES = (np.arange(BINS + 1) / BINS) ** 2 * (np.pi / 2)
_SOLID_ANGLE = 2 * np.pi * -np.diff(np.cos(_EDGES))


@dataclass(frozen=True, eq=False)
class HalfVectorTable:
    """`cosine`: share of the cosine lobe; `probability` (90,) of each theta_half bin, of the rest."""

    cosine: float
    probability: Array

    def sample(self, w_o: Array, u: Array) -> Array:
        """Directions w_i (n, 3), also below the horizon."""
        diffuse = u[:, 2] < self.cosine
        azimuth = 2 * np.pi * u[:, 1]
        cumulative = np.concatenate([[0.0], np.cumsum(self.probability)])
        # Uniform in cos(theta_half) within a bin.
        cos_h = np.interp(u[:, 0] * cumulative[-1], cumulative, np.cos(_EDGES))
        cos_t = np.where(diffuse, np.sqrt(1 - u[:, 0]), cos_h)
        sin_t = np.sqrt(np.maximum(1 - cos_t**2, 0.0))
        local = np.stack([sin_t * np.cos(azimuth), sin_t * np.sin(azimuth), cos_t], axis=-1)
        reflected = 2 * np.sum(w_o * local, axis=-1, keepdims=True) * local - w_o
        return np.where(diffuse[:, None], local, reflected)

    def pdf(self, w_i: Array, w_o: Array) -> Array:
        """The density (n,) of `sample`, sr^-1."""
        half = w_i + w_o
        length = np.linalg.norm(half, axis=-1)
        # Of h and -h, which reflect alike, the one above the horizon was sampled.
        cos_h = np.abs(half[:, 2]) / np.maximum(length, 1e-300)
        cos_d = length / 2
        theta_h = np.arccos(np.minimum(cos_h, 1.0))
        bins = np.minimum((np.sqrt(theta_h / (np.pi / 2)) * BINS).astype(int), BINS - 1)
        density = (self.probability / _SOLID_ANGLE)[bins] / np.maximum(4 * cos_d, 1e-12)
        return self.cosine * np.maximum(w_i[:, 2], 0.0) / np.pi + (1 - self.cosine) * density


class Evaluating(Protocol):
    """What the table of a model is made from."""

    def evaluate(self, w_i: Array, w_o: Array) -> Array: ...


class HalfVectorSampling:
    """Adds `sample` and `pdf` to a model that evaluates."""

    def sample(self, w_o: Array, u: Array) -> Array:
        return self._half_vectors.sample(w_o, u)

    def pdf(self, w_i: Array, w_o: Array) -> Array:
        return self._half_vectors.pdf(w_i, w_o)

    @cached_property
    def _half_vectors(self) -> HalfVectorTable:
        return half_vector_table(self)  # type: ignore[arg-type]


def half_vector_table(model: Evaluating) -> HalfVectorTable:
    """The table of an isotropic model, from its mean over channels and over a few difference angles."""
    theta_h = (_EDGES[1:] + _EDGES[:-1]) / 2
    theta_d = np.radians([2.0, 15.0, 30.0, 45.0, 60.0])
    phi_d = np.radians([45.0, 90.0, 135.0])
    angles = np.meshgrid(theta_h, theta_d, phi_d, indexing="ij")
    w_i, w_o = directions(*(angle.ravel() for angle in angles))
    shape = (BINS, len(theta_d) * len(phi_d))
    values = np.mean(model.evaluate(w_i, w_o), axis=1).reshape(shape)
    seen = ((w_i[:, 2] > 0) & (w_o[:, 2] > 0)).reshape(shape)
    profile = values.sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    base = float(profile[theta_h < np.radians(60)].min())
    # The light that a half vector's bin reflects: 4 cos(theta_d) cos(theta_i) d omega_h, about 4 cos(theta_h).
    highlight = np.maximum(profile - base, 0.0) * np.cos(theta_h) * _SOLID_ANGLE
    total, diffuse = 4 * float(highlight.sum()), np.pi * base
    if total <= 0:
        return HalfVectorTable(1 - LEAST_SHARE, _SOLID_ANGLE / _SOLID_ANGLE.sum())
    cosine = float(np.clip(diffuse / (diffuse + total), LEAST_SHARE, 1 - LEAST_SHARE))
    return HalfVectorTable(cosine, highlight / highlight.sum())
