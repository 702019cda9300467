"""What eq. 12 needs of a material: its luminance where light and view coincide, over the elevation."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fitters.errors import FittersError
from fitters.grid import Array, bin_centres
from fitters.materials import Material
from fitters.models.power_iterations.isotropic import nodes

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
ADVICE = "Power iterations extract the distribution from backscattering alone: fit a formula to this material."


Evaluate = Callable[[Array, Array], Array]
"""BRDF (n, 3), sr^-1, of unit directions w_i and w_o (n, 3)."""


class Backscattering(NamedTuple):
    """`values` (..., n): luminance of f_r(o, o), sr^-1, at `isotropic.nodes(n)`; what was done to get it."""

    values: Array
    warnings: tuple[str, ...]


def of_table(material: Material, count: int) -> Backscattering:
    """From the bins with theta_diff 0.5 degrees, averaged over their valid azimuths; others are filled in.

    Raises `FittersError` where there is no valid or no bright cell.
    """
    valid = material.valid[:, 0, :]
    cells = np.count_nonzero(valid, axis=1)
    known = cells > 0
    if not known.any():
        raise FittersError(
            f"{material.name}: no cell with theta_diff below 1 degree is valid, so nothing is known of its "
            f"backscattering. {ADVICE}"
        )
    sums = LUMINANCE @ material.table[:, :, 0, :].sum(axis=2, dtype=np.float64)
    luminance = sums / np.maximum(cells, 1)
    check(material.name, luminance)
    warnings = []
    if not known.all():
        centres = bin_centres()[0]
        luminance = np.interp(centres, centres[known], luminance[known])
        warnings.append(
            f"{np.count_nonzero(~known)} of {len(known)} theta_half bins have no valid backscattering cell: "
            "filled linearly from their neighbours, constant beyond the last."
        )
    if count != len(luminance):
        luminance = np.interp(nodes(count), bin_centres()[0], luminance)
    return Backscattering(luminance, tuple(warnings))


def of_function(name: str, evaluate: Evaluate, azimuths: Array, count: int) -> Backscattering:
    """From a BRDF at every direction of the tables: `values` (phi, theta) at the given azimuths."""
    theta, phi = (angle.ravel() for angle in np.meshgrid(nodes(count), azimuths))
    w = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    luminance = (evaluate(w, w) @ LUMINANCE).reshape(len(azimuths), count)
    check(name, luminance)
    return Backscattering(luminance, ())


def check(name: str, luminance: Array) -> None:
    """Raise `FittersError` where a material sends nothing back, or something that is no number."""
    if not np.all(np.isfinite(luminance)) or np.any(luminance < 0):
        raise FittersError(
            f"{name}: its backscattering holds negative, NaN or infinite values. Check the material."
        )
    if not luminance.any():
        raise FittersError(f"{name}: its backscattering is 0 in every direction. {ADVICE}")
