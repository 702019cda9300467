"""The tables of the paper's own implementation, quirk by quirk: what `Settings.reference()` extracts.

Nodes are u = i / (n - 1) with theta = u^2 pi / 2 for P and theta = u pi / 2 for G1 and the Fresnel term; tables
are linear in u. For G1, the projected area sigma(k) = cos(theta_k) / G1(k) is interpolated. `settings` lists what
the default does otherwise, and why.
"""

from collections.abc import Callable

import numpy as np

from fitters.grid import SHAPE, Array
from fitters.materials import Material
from fitters.models.power_iterations.backscattering import LUMINANCE, check

AZIMUTH_STEPS = 361
SNAPPED_COS = 0.99999
"""Directions nearer to their axis than this are taken to lie on it."""
LEAST_IDEAL = 1e-4
PHI_BIN = SHAPE[2] // 2
"""Where phi_d = 90 degrees, the edge of two bins, is looked up; in the original, rounding decides cell by cell."""
ITERATIONS, INTEGRATION_STEPS, AREA_STEPS, AREA_AZIMUTHS = 4, 128, 90, 180


def slope_pdf(material: Material, count: int) -> tuple[Array, Array]:
    """Nodes theta (count,) and P (count,), the last 0: four iterations, left Riemann sums.

    Raises `FittersError` where the material shows no backscattering.
    """
    u = np.arange(count) / (count - 1)
    theta = u**2 * (np.pi / 2)
    bins = _half_bins(theta[:-1])
    backscattering = LUMINANCE @ material.table[:, bins, 0, 0].astype(np.float64)
    check(material.name, backscattering)
    tangent, cosine = np.tan(theta[:-1]), np.cos(theta[:-1])
    product = np.outer(tangent, tangent)
    azimuth = np.arange(AZIMUTH_STEPS) * (np.pi / 180)
    clamped = np.zeros_like(product)
    for cos_phi in np.cos(azimuth):
        clamped += np.maximum(1.0, product * cos_phi)
    kernel = (8 * backscattering * cosine**6)[:, None] * clamped * (u[:-1] * tangent / cosine**2)
    p = np.ones(count - 1)
    for _ in range(ITERATIONS):
        p = kernel @ p
        p /= p.max()
    p = np.append(p, 0.0)
    return theta, p / _moment(p, lambda r: np.ones_like(r))


def projected_area(p: Array) -> Array:
    """sigma (n,) at theta = i / (n - 1) pi / 2 for P (n,): 90 x 180 left Riemann sums, the last one repeated."""
    count = len(p)
    theta_k = np.arange(count - 1) / (count - 1) * (np.pi / 2)
    u = np.arange(AREA_STEPS) / AREA_STEPS
    theta_h = u**2 * (np.pi / 2)
    weight = at_slopes(p, u) / np.cos(theta_h) ** 4 * u * np.sin(theta_h)
    cos_phi = np.cos(np.arange(AREA_AZIMUTHS) / AREA_AZIMUTHS * 2 * np.pi)
    area = np.zeros(count - 1)
    for cosine in cos_phi:
        facing = np.outer(np.sin(theta_k), np.sin(theta_h)) * cosine + np.outer(np.cos(theta_k), np.cos(theta_h))
        area += np.maximum(facing, 0.0) @ weight
    area = np.maximum(np.cos(theta_k), area * (np.pi / AREA_STEPS) * (2 * np.pi / AREA_AZIMUTHS))
    return np.append(area, area[-1])


def fresnel(material: Material, p: Array, area: Array) -> Array:
    """F (n, 3) at theta_d = i / (n - 1) pi / 2: mean of data over model along theta_half, phi_d = 90 degrees."""
    count = len(p)
    u = np.arange(count) / (count - 1)
    theta_h = u**2 * (np.pi / 2)
    half_bins = _half_bins(theta_h)
    steepness = np.where(np.cos(theta_h) > LEAST_IDEAL, p / np.cos(theta_h) ** 4, 0.0)
    table = np.zeros((count, 3))
    for i, theta_d in enumerate(u[:-1] * (np.pi / 2)):
        # The loop of the original looks at the previous node, and so takes one beyond the limit.
        taken = min(count, 1 + np.searchsorted(theta_h, np.pi / 2 - theta_d))
        cosine = np.cos(theta_h[:taken]) * np.cos(theta_d)
        sigma = np.interp(np.arccos(cosine), u * (np.pi / 2), area)
        ideal = steepness[:taken] / (4 * (2 * sigma * cosine - cosine**2))
        snapped = np.cos(theta_d) > SNAPPED_COS
        diff_bin, phi_bin = (0, 0) if snapped else (int(u[i] * SHAPE[1]), PHI_BIN)
        used = ideal > LEAST_IDEAL
        data = material.table[:, half_bins[:taken], diff_bin, phi_bin].astype(np.float64)
        table[i] = np.minimum(1.0, np.mean(data[:, used] / ideal[used], axis=1)) if used.any() else 1.0
    table[-1] = table[-2]
    return table


def alphas(p: Array) -> tuple[float, float]:
    """Beckmann's and GGX's alpha of P (n,), from the second and the first absolute moment of the slope."""
    return float(np.sqrt(_moment(p, np.square))), float(_moment(p, lambda r: 2 / np.pi * r))


def at_slopes(p: Array, u: Array) -> Array:
    """P, linear between its nodes, at theta = u^2 pi / 2."""
    return np.interp(u, np.arange(len(p)) / (len(p) - 1), p)


def _moment(p: Array, of_slope: Callable[[Array], Array]) -> float:
    u = np.arange(INTEGRATION_STEPS) / INTEGRATION_STEPS
    r, cosine = np.tan(u**2 * (np.pi / 2)), np.cos(u**2 * (np.pi / 2))
    terms = u * at_slopes(p, u) * r * of_slope(r) / cosine**2
    return float(np.sum(terms)) * (np.pi / INTEGRATION_STEPS) * 2 * np.pi


def _half_bins(theta_half: Array) -> Array:
    snapped = np.where(np.cos(theta_half) > SNAPPED_COS, 0.0, theta_half)
    return np.minimum((np.sqrt(snapped / (np.pi / 2)) * SHAPE[0]).astype(int), SHAPE[0] - 1)
