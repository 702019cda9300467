"""The Fresnel term of eq. 20: the mean ratio of the measurement to the model with ideal mirrors, per theta_d."""

import math

import numpy as np

from fitters import compiled
from fitters.grid import SHAPE, Array, bin_centres, directions
from fitters.materials import Material
from fitters.models.power_iterations.backscattering import Evaluate
from fitters.models.power_iterations.isotropic import nodes
from fitters.models.power_iterations.model import projected_area

LEAST_IDEAL = 1e-4
"""Where the model with ideal mirrors lies below this, in sr^-1, the ratio says nothing."""
STRIDE = 3
"""Of the grid's 180 azimuths every third is averaged, in mirrored pairs: 5,400 cells for each theta_diff."""
ELEVATIONS, AZIMUTHS = 24, 12
"""Half vectors over the elevation, and over both azimuths, of the average for anisotropic materials."""


def table(material: Material, ndf: Array, area: Array) -> Array:
    """F (90, 3) at the centres of the theta_diff bins, valid cells averaged alike.

    `ndf` (90,) is D at the centres of the theta_half bins, sr^-1; `area` (m,) sigma at the nodes of
    `isotropic.area_nodes`. A bin without a usable cell takes the value of the nearest bins.
    """
    sums, counts = np.zeros((SHAPE[1], 3)), np.zeros(SHAPE[1])
    theta_half, theta_diff, phi_diff = bin_centres()
    chosen = slice(STRIDE // 2, None, STRIDE)
    data, valid = material.table[..., chosen], material.valid[..., chosen]
    _ratios(data, valid, theta_half, theta_diff, np.cos(phi_diff[chosen]), ndf, area, sums, counts)
    return filled(sums, counts)


def table_of(evaluate: Evaluate, ideal: Evaluate) -> Array:
    """F (90, 3) of a BRDF over the one with ideal mirrors, averaged over theta_h, phi_h and phi_d."""
    theta_d = bin_centres()[1]
    angles = np.meshgrid(nodes(ELEVATIONS), theta_d, _middles(AZIMUTHS), _middles(AZIMUTHS), indexing="ij")
    theta_h, diff, phi_d, phi_h = (angle.ravel() for angle in angles)
    w_i, w_o = (_turned(w, phi_h) for w in directions(theta_h, diff, phi_d))
    model = ideal(w_i, w_o)[:, 0]
    used = (w_i[:, 2] > 0) & (w_o[:, 2] > 0) & (model > LEAST_IDEAL)
    ratio = np.zeros((len(model), 3))
    ratio[used] = evaluate(w_i[used], w_o[used]) / model[used, None]
    shape = angles[0].shape
    return filled(ratio.reshape(*shape, 3).sum(axis=(0, 2, 3)), used.reshape(shape).sum(axis=(0, 2, 3)))


def table_at(w_i: Array, w_o: Array, values: Array, ideal: Evaluate) -> Array:
    """F (90, 3) of values (n, 3) measured at directions (n, 3), averaged as they are, nothing interpolated."""
    model = ideal(w_i, w_o)[:, 0]
    used = (w_i[:, 2] > 0) & (w_o[:, 2] > 0) & (model > LEAST_IDEAL)
    theta_d = np.arccos(np.minimum(np.linalg.norm(w_i[used] + w_o[used], axis=-1) / 2, 1.0))
    bins = np.minimum((theta_d / (np.pi / 2) * SHAPE[1]).astype(int), SHAPE[1] - 1)
    ratio = values[used] / model[used, None]
    sums, counts = np.zeros((SHAPE[1], 3)), np.zeros(SHAPE[1])
    np.add.at(sums, bins, ratio)
    np.add.at(counts, bins, 1.0)
    return filled(sums, counts)


def _middles(count: int) -> Array:
    return (np.arange(count) + 0.5) / count * 2 * np.pi


def _turned(w: Array, phi: Array) -> Array:
    """Directions (n, 3) turned about the normal by angles (n,)."""
    x, y = w[:, 0] * np.cos(phi) - w[:, 1] * np.sin(phi), w[:, 0] * np.sin(phi) + w[:, 1] * np.cos(phi)
    return np.stack([x, y, w[:, 2]], axis=-1)


def filled(sums: Array, counts: Array) -> Array:
    """Means (k, 3) of sums (k, 3) over counts (k,), linear across bins without any; 1 where all are without."""
    known = counts > 0
    if not known.any():
        return np.ones_like(sums)
    at = np.arange(len(sums))
    means = sums[known] / counts[known, None]
    return np.stack([np.interp(at, at[known], means[:, channel]) for channel in range(3)], axis=-1)


@compiled.entry(error_model="numpy", fastmath={"reassoc", "contract"})
def _ratios(
    data: Array,
    valid: Array,
    theta_half: Array,
    theta_diff: Array,
    cos_phi: Array,
    ndf: Array,
    area: Array,
    sums: Array,
    counts: Array,
) -> None:
    azimuths = cos_phi.shape[0]
    inverse = np.zeros(azimuths, np.float32)
    for i in range(theta_half.shape[0]):
        if ndf[i] <= 0.0:
            continue
        scale, largest = 4 / ndf[i], 1 / LEAST_IDEAL
        for j in range(theta_diff.shape[0]):
            product = math.cos(theta_half[i]) * math.cos(theta_diff[j])
            swing = math.sin(theta_half[i]) * math.sin(theta_diff[j])
            # The mirrored azimuth swaps the two cosines: both cells meet the same model.
            for k in range(azimuths // 2):
                cos_i, cos_o = max(product - swing * cos_phi[k], 0.0), product + swing * cos_phi[k]
                area_i, area_o = projected_area(cos_i, area, False), projected_area(cos_o, area, False)
                ideal = scale * (area_i * cos_o + area_o * cos_i - cos_i * cos_o)
                inverse[k] = ideal if cos_i > 0.0 and ideal < largest else 0.0
                inverse[azimuths - 1 - k] = inverse[k]
            # The data are 0 where they are not valid.
            red, green, blue, used = np.float32(0), np.float32(0), np.float32(0), 0
            for k in range(azimuths):
                red += data[0, i, j, k] * inverse[k]
                green += data[1, i, j, k] * inverse[k]
                blue += data[2, i, j, k] * inverse[k]
                used += valid[i, j, k] and inverse[k] > 0
            sums[j, 0] += red
            sums[j, 1] += green
            sums[j, 2] += blue
            counts[j] += used
