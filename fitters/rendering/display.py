"""How linear radiance is shown: one exposure, chosen from the truth, for it and for every model of it."""

import numpy as np

from fitters.errors import FittersError
from fitters.grid import Array
from fitters.rendering.picture import Picture

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Shares of linear red, green and blue in luminance, BT.709."""

MIDDLE_GREY = 0.18
"""The linear display value at which the typical pixel of the truth is shown: that of a photographer's card."""

WHITE = 203.0
"""cd/m^2 of a display value of 1: the diffuse white of BT.2408."""

PROTOCOL = (
    f"exposure from the truth alone: the median luminance of its foreground (black pixels left out) is shown at "
    f"{MIDDLE_GREY}; tone curve 1 - exp2(-exposure L) per channel (Bagher et al. 2016), sRGB transfer function"
)

ABSOLUTE_PROTOCOL = (
    f"exposure as for the display, without its tone curve: ln 2 exposure L = 1 is {WHITE:g} cd/m^2 (BT.2408), so "
    "shadows are as bright as shown; BT.709 primaries"
)


def exposure(truth: Picture) -> float:
    """The exposure under which `displayed` shows the truth's median luminance as middle grey, before sRGB.

    The median and not the mean: a few pixels of a bright window would darken all others. Pixels without light
    say nothing about the material and are left out. Raises `FittersError` for a picture that is black.
    """
    luminance = truth.pixels[truth.foreground] @ LUMINANCE
    lit = luminance[luminance > 0]
    if not len(lit):
        raise FittersError("the true picture is black: no light reaches what is seen; rotate the light")
    return float(-np.log2(1 - MIDDLE_GREY) / np.median(lit))


def displayed(picture: Picture, exposure: float) -> Array:
    """(h, w, 3) in [0, 1], sRGB: the tone curve of Bagher et al. 2016, section 5, then the transfer function.

    Negative radiance is shown as black.
    """
    return srgb(-np.expm1(-np.log(2) * exposure * np.maximum(picture.pixels, 0.0)))


def absolute(picture: Picture, exposure: float) -> Array:
    """Display light (h, w, 3) in cd/m^2, BT.709 primaries, of a display without a shoulder; not negative.

    ln 2 is the slope of the tone curve at black: where that has not bent yet, both displays show the same.
    """
    return WHITE * np.log(2) * exposure * np.maximum(picture.pixels, 0.0)


def srgb(linear: Array) -> Array:
    """The sRGB transfer function (IEC 61966-2-1) of linear values in [0, 1]."""
    return np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    )
