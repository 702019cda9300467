"""Directions sampled for any isotropic model: a tabulated distribution of half vectors, mixed with a cosine lobe.

The distribution over theta_half follows the model's own highlight, as that of Walter et al. 2007 (section 5.2)
follows a formula's; what reflects without a highlight is left to the cosine lobe, whose share depends on the view.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from fitters.grid import Array
from fitters.models.directions import rows

BINS, VIEWS, AZIMUTHS = 90, 18, 24
LEAST_SHARE = 0.05
"""Neither of the two ways of sampling is chosen more rarely than this."""

_EDGES = (np.arange(BINS + 1) / BINS) ** 2 * (np.pi / 2)
_SOLID_ANGLE = 2 * np.pi * -np.diff(np.cos(_EDGES))
_VIEW_ANGLES = (np.arange(VIEWS) + 0.5) / VIEWS * (np.pi / 2)


@dataclass(frozen=True, eq=False)
class HalfVectorTable:
    """`cosine` (18,): share of the cosine lobe at views 2.5, 7.5, .. 87.5 degrees from the normal, linear between.

    `probability` (90,): of each theta_half bin, of the rest.
    """

    cosine: Array
    probability: Array

    def share(self, w_o: Array) -> Array:
        """Of the cosine lobe (n,), at views (n, 3)."""
        return np.interp(np.arccos(np.clip(w_o[:, 2], -1.0, 1.0)), _VIEW_ANGLES, self.cosine)

    def sample(self, w_o: Array, u: Array) -> Array:
        """Directions w_i (n, 3), also below the horizon."""
        diffuse = u[:, 2] < self.share(w_o)
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
        # Of h and -h, which reflect alike, the one above the horizon was sampled.
        theta_h = np.arctan2(np.hypot(half[:, 0], half[:, 1]), np.abs(half[:, 2]))
        cos_d = np.linalg.norm(half, axis=-1) / 2
        bins = np.minimum((np.sqrt(theta_h / (np.pi / 2)) * BINS).astype(int), BINS - 1)
        density = (self.probability / _SOLID_ANGLE)[bins] / np.maximum(4 * cos_d, 1e-12)
        cosine = self.share(w_o)
        return cosine * np.maximum(w_i[:, 2], 0.0) / np.pi + (1 - cosine) * density


class Evaluating(Protocol):
    """What the table of a model is made from."""

    def evaluate(self, w_i: Array, w_o: Array) -> Array: ...


class HalfVectorSampling:
    """Adds `sample` and `pdf` to a model that evaluates."""

    def sample(self, w_o: Array, u: Array) -> Array:
        return self._half_vectors.sample(rows(w_o), rows(u))

    def pdf(self, w_i: Array, w_o: Array) -> Array:
        return self._half_vectors.pdf(rows(w_i), rows(w_o))

    @cached_property
    def _half_vectors(self) -> HalfVectorTable:
        return half_vector_table(self)  # type: ignore[arg-type]


def half_vector_table(model: Evaluating) -> HalfVectorTable:
    """The table of an isotropic model, from its mean over channels: views by half vectors of every bin."""
    w_i, w_o, measure = _mirrored()
    values = np.mean(model.evaluate(w_i, w_o), axis=1)
    # Scaled, so that no sum of values overflows.
    values = (values / (values.max() or 1.0)).reshape(measure.shape)
    seen = (w_i[:, 2] > 0).reshape(measure.shape)
    profile = values.sum(axis=(0, 2)) / np.maximum(seen.sum(axis=(0, 2)), 1)
    base = float(profile[_EDGES[1:] < np.radians(60)].min())
    highlight = np.sum(np.maximum(values - base, 0.0) * measure, axis=2)
    reflected = highlight.sum(axis=1)
    if not reflected.any():
        return HalfVectorTable(np.full(VIEWS, 1 - LEAST_SHARE), _SOLID_ANGLE / _SOLID_ANGLE.sum())
    cosine = np.clip(np.pi * base / (np.pi * base + reflected), LEAST_SHARE, 1 - LEAST_SHARE)
    probability = highlight.T @ np.cos(_VIEW_ANGLES)
    return HalfVectorTable(cosine, probability / probability.sum())


def _mirrored() -> tuple[Array, Array, Array]:
    """w_i and w_o (n, 3) for each view, theta_half bin and azimuth, and cos(theta_i) d omega_i (18, 90, 24)."""
    azimuth = (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS * np.pi
    theta_h = (_EDGES[1:] + _EDGES[:-1]) / 2
    view, theta, phi = np.meshgrid(_VIEW_ANGLES, theta_h, azimuth, indexing="ij")
    half = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    w_o = np.stack([np.sin(view), np.zeros_like(view), np.cos(view)], axis=-1)
    cos_d = np.sum(half * w_o, axis=-1)
    w_i = 2 * cos_d[..., None] * half - w_o
    measure = np.maximum(w_i[..., 2], 0.0) * 4 * np.maximum(cos_d, 0.0) * (_SOLID_ANGLE[:, None] / AZIMUTHS)
    return w_i.reshape(-1, 3), w_o.reshape(-1, 3), measure
