"""A material in numbers: cells, range, albedo."""

from dataclasses import dataclass

import numpy as np

from fitters.grid import CELLS, Array, above_horizon, cell_index, half_diff
from fitters.materials.material import RGB, Material

ALBEDO_DEGREES = (0.0, 45.0, 75.0)
HALF_ELEVATIONS, HALF_AZIMUTHS = 180, 256
HEMISPHERE_NODES = 16


@dataclass(frozen=True)
class DirectionalAlbedo:
    """The share of light from `theta_i` (degrees) that is reflected, per channel."""

    theta_i: float
    albedo: RGB


@dataclass(frozen=True)
class MaterialSummary:
    """Cells, range and albedo of a material; triples are RGB, reflectances sr^-1 over the valid cells.

    `invalid_share` is the share of cells above the horizon that are not usable, `negative_share` that of
    valid cells whose sample was below zero. `hemispherical_albedo` is the albedo under a uniformly bright sky.
    `gains_energy`: whether an albedo exceeds 1.
    """

    name: str
    source: str
    sha256: str
    cells: int
    above_horizon: int
    valid: int
    invalid_share: float
    negative_share: RGB
    minimum: RGB
    median: RGB
    maximum: RGB
    directional_albedo: tuple[DirectionalAlbedo, ...]
    hemispherical_albedo: RGB
    gains_energy: bool


def summarise(material: Material) -> MaterialSummary:
    """The summary of a material, as `gpsearch materials` prints it."""
    above, valid = int(np.count_nonzero(above_horizon())), int(np.count_nonzero(material.valid))
    values = material.table[:, material.valid]
    directional = directional_albedo(material, np.radians(ALBEDO_DEGREES))
    hemispherical = hemispherical_albedo(material)
    return MaterialSummary(
        name=material.name,
        source=material.source,
        sha256=material.sha256,
        cells=CELLS,
        above_horizon=above,
        valid=valid,
        invalid_share=1.0 - valid / above,
        negative_share=material.negative,
        minimum=_rgb(values.min(axis=1)),
        median=_rgb(np.median(values, axis=1)),
        maximum=_rgb(values.max(axis=1)),
        directional_albedo=tuple(
            DirectionalAlbedo(degrees, _rgb(albedo))
            for degrees, albedo in zip(ALBEDO_DEGREES, directional, strict=True)
        ),
        hemispherical_albedo=_rgb(hemispherical),
        gains_energy=bool(directional.max() > 1.0 or hemispherical.max() > 1.0),
    )


def directional_albedo(material: Material, theta_i: Array) -> Array:
    """Directional albedo (n, 3) at n incident elevations in radians; cells that are not valid count as black.

    Integrates over half vectors, d omega_o = 4 (w_i . h) d omega_h, at half the grid's spacing in theta_half, so
    that the narrowest highlight of a table has as many samples as a broad one.
    """
    edges = (np.arange(HALF_ELEVATIONS + 1) / HALF_ELEVATIONS) ** 2 * (np.pi / 2)
    theta_h = ((np.arange(HALF_ELEVATIONS) + 0.5) / HALF_ELEVATIONS) ** 2 * (np.pi / 2)
    phi_h = (np.arange(HALF_AZIMUTHS) + 0.5) / HALF_AZIMUTHS * (2 * np.pi)
    solid_angle = np.repeat(-np.diff(np.cos(edges)) * (2 * np.pi / HALF_AZIMUTHS), HALF_AZIMUTHS)
    theta, phi = (a.ravel() for a in np.meshgrid(theta_h, phi_h, indexing="ij"))
    half = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    flat = material.table.reshape(3, -1)
    out = np.zeros((len(theta_i), 3))
    for k, angle in enumerate(theta_i):
        w_i = np.array([np.sin(angle), 0.0, np.cos(angle)])
        cos_d = half @ w_i
        w_o = 2.0 * cos_d[:, None] * half - w_i
        seen = np.flatnonzero((cos_d > 0) & (w_o[:, 2] > 0))
        cells = cell_index(*half_diff(np.broadcast_to(w_i, (len(seen), 3)), w_o[seen]))
        out[k] = flat[:, cells] @ (4.0 * cos_d[seen] * w_o[seen, 2] * solid_angle[seen])
    return out


def hemispherical_albedo(material: Material) -> Array:
    """Albedo (3,) under a uniformly bright sky: 2 times the integral of albedo cos sin over theta_i."""
    nodes, weights = np.polynomial.legendre.leggauss(HEMISPHERE_NODES)
    sin_squared = 0.5 * (nodes + 1.0)
    return 0.5 * weights @ directional_albedo(material, np.arcsin(np.sqrt(sin_squared)))


def _rgb(values: Array) -> RGB:
    r, g, b = (float(v) for v in values)
    return r, g, b
