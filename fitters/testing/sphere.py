"""Sums over the sphere of directions by half vectors, which follow what a BRDF reflects however narrow it is.

Every direction w_i is the mirror image of w_o at one upper half vector h; d omega_i = 4 |o.h| d omega_h.
"""

import numpy as np
from scipy.stats import chisquare

from fitters.grid import Array
from fitters.models.model import Model

RINGS, SECTORS = 720, 288
PATCH_RINGS, PATCH_SECTORS = 18, 12


def direction(theta: Array | float, phi: Array | float = 0.0) -> Array:
    """Unit vectors (..., 3) at polar angles theta from the normal and azimuths phi, radians."""
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def random_directions(count: int, seed: int, least_cos: float = 0.02) -> Array:
    """Unit vectors (count, 3), their cosines uniform from `least_cos` to 1."""
    random = np.random.default_rng(seed)
    return direction(np.arccos(random.uniform(least_cos, 1, count)), random.uniform(0, 2 * np.pi, count))


def directions(w_o: Array) -> tuple[Array, Array]:
    """w_i (n, 3) and their solid angles (n,) for one view, rings of half vectors even in sqrt(theta_half)."""
    u = (np.arange(RINGS) + 0.5) / RINGS
    phi = (np.arange(SECTORS) + 0.5) / SECTORS * 2 * np.pi
    theta, phi = (angle.ravel() for angle in np.meshgrid(u**2 * np.pi / 2, phi, indexing="ij"))
    half = direction(theta, phi)
    edges = np.cos((np.arange(RINGS + 1) / RINGS) ** 2 * np.pi / 2)
    solid_angle = np.repeat(-np.diff(edges), SECTORS) * 2 * np.pi / SECTORS
    cos_d = half @ w_o
    return 2 * cos_d[:, None] * half - w_o, 4 * np.abs(cos_d) * solid_angle


def p_value(model: Model, w_o: Array, w_i: Array) -> float:
    """Of the chi-square test that samples w_i (n, 3) for one view have the model's density.

    Patches of half vectors, those of directions below the horizon included; rare ones are counted as one.
    """
    at, measure = directions(w_o)
    mass = (model.pdf(at, np.tile(w_o, (len(at), 1))) * measure).reshape(
        PATCH_RINGS, RINGS // PATCH_RINGS, PATCH_SECTORS, SECTORS // PATCH_SECTORS
    )
    expected = mass.sum(axis=(1, 3)).ravel()
    expected *= len(w_i) / expected.sum()
    observed = np.bincount(_patch(w_i + w_o), minlength=len(expected))
    rare = expected < 5
    if rare.any():
        expected = np.append(expected[~rare], expected[rare].sum())
        observed = np.append(observed[~rare], observed[rare].sum())
    if expected[-1] < 5:
        # Patches that are rare even together have a bound of their own.
        assert observed[-1] < 25
        expected, observed = expected[:-1], observed[:-1]
        expected = expected * (observed.sum() / expected.sum())
    return float(chisquare(observed, expected).pvalue)


def _patch(half: Array) -> Array:
    upper = np.where(half[:, 2:] < 0, -half, half)
    theta = np.arctan2(np.hypot(upper[:, 0], upper[:, 1]), upper[:, 2])
    ring = np.minimum((np.sqrt(theta / (np.pi / 2)) * PATCH_RINGS).astype(int), PATCH_RINGS - 1)
    sector = (np.arctan2(upper[:, 1], upper[:, 0]) / (2 * np.pi) % 1 * PATCH_SECTORS).astype(int) % PATCH_SECTORS
    return ring * PATCH_SECTORS + sector
