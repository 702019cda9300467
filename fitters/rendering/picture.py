"""A picture of linear radiance, and how it is shown: one exposure, chosen from the truth, for all models of it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.errors import FittersError
from fitters.grid import Array

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Weights of linear red, green and blue in luminance, BT.709."""

MIDDLE_GREY = 0.18
"""The linear display value of the truth's median pixel: the grey of a photographer's test card."""

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


@dataclass(frozen=True, eq=False)
class Picture:
    """Linear radiance of an object against black.

    `pixels` (h, w, 3) float64, RGB with the primaries of the light (assumed to be those of BT.709), row 0 at the
    top, 0 outside `foreground` (h, w) bool. Raises `FittersError` unless shapes and types fit, every pixel is
    finite and some belong to the foreground.
    """

    pixels: Array
    foreground: NDArray[np.bool_]

    def __post_init__(self) -> None:
        shape = self.pixels.shape
        if len(shape) != 3 or shape[2] != 3 or self.pixels.dtype != np.float64:
            raise FittersError(f"picture: pixels are float64 (h, w, 3), not {self.pixels.dtype} {shape}")
        if self.foreground.shape != shape[:2] or self.foreground.dtype != np.bool_:
            raise FittersError(
                f"picture: a foreground is bool {shape[:2]}, not {self.foreground.dtype} {self.foreground.shape}"
            )
        if not self.foreground.any():
            raise FittersError("picture: no pixel shows the object")
        wrong = int(np.count_nonzero(~np.isfinite(self.pixels)))
        if wrong:
            raise FittersError(f"picture: {wrong} values are NaN or infinite; the model is not finite everywhere")
        if np.any(self.pixels[~self.foreground]):
            raise FittersError("picture: some pixels outside the foreground are not 0")


def exposure(truth: Picture) -> float:
    """The exposure under which `displayed` shows the truth's median luminance as middle grey, before sRGB.

    The median and not the mean, because a few pixels of a bright window would make all others dark. Pixels without
    light show nothing of the material and are left out. Raises `FittersError` for a picture that is black.
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
    """Display light (h, w, 3) in cd/m^2, BT.709 primaries, without a tone curve; not negative.

    ln 2 is the slope of the tone curve at black: dark pixels are as bright as with `displayed`.
    """
    return WHITE * np.log(2) * exposure * np.maximum(picture.pixels, 0.0)


def srgb(linear: Array) -> Array:
    """The sRGB transfer function (IEC 61966-2-1) of linear values in [0, 1]."""
    return np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    )
