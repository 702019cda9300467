"""Differences of colour per pixel, by colour-science."""

import functools
import warnings
from typing import Any

import numpy as np

from fitters.grid import Array

PEAK = 10000.0
"""cd/m^2 at which the transfer function of SMPTE ST 2084 ends."""


def delta_e_2000(truth: Array, model: Array) -> Array:
    """CIEDE2000 (n,) between sRGB colours (n, 3) in [0, 1], through CIELAB for D65 and the 2 degree observer."""
    colour = _colour_science()
    first, second = (colour.XYZ_to_Lab(colour.sRGB_to_XYZ(shown)) for shown in (truth, model))
    return lab_difference(first, second)


def lab_difference(truth: Array, model: Array) -> Array:
    """CIEDE2000 (n,) between CIELAB colours (n, 3), all weights 1."""
    return np.asarray(_colour_science().delta_E(truth, model, method="CIE 2000"))


def delta_e_itp(truth: Array, model: Array) -> Array:
    """Delta E ITP (n,) after BT.2124 between display lights (n, 3) in cd/m^2 of BT.709 primaries."""
    first, second = (ictcp(light) for light in (truth, model))
    return np.asarray(_colour_science().delta_E(first, second, method="ITP"))


def ictcp(light: Array) -> Array:
    """ICtCp (n, 3) of BT.2100, PQ, of display light (n, 3) in cd/m^2 of BT.709 primaries, clipped at the peak."""
    colour = _colour_science()
    wide = light @ colour.matrix_RGB_to_RGB("ITU-R BT.709", "ITU-R BT.2020", chromatic_adaptation_transform=None).T
    return colour.RGB_to_ICtCp(np.clip(wide, 0.0, PEAK))


@functools.cache
def _colour_science() -> Any:
    """The library, imported where it is first used: it takes seconds, and warns of what is not installed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour
