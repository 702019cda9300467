"""Environment maps from .hdr and .exr files, through OpenImageIO."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from fitters.errors import FittersError
from fitters.grid import Array
from fitters.scenes.environment import EnvironmentMap

FORMATS = ("hdr", "openexr")
MAX_ROWS = 8192
NEGLIGIBLE = 1e-4
"""Negative values below this share of the mean come from image filters and are read as 0."""


def read_map(path: Path) -> EnvironmentMap:
    """The latitude-longitude map in a .hdr or .exr file, at the file's own resolution.

    Values are taken as the file stores them (a Radiance EXPOSURE line is not undone). Raises `FittersError`
    for anything that is not a whole, upright, finite 2:1 RGB image.
    """
    if os.path.isdir(path):
        raise FittersError(f"{path}: is a folder; name a .hdr or .exr file in it")
    if not os.path.exists(path):
        raise FittersError(f"{path}: no such file that may be read; check the path of the light")
    try:
        return EnvironmentMap(clean(read_rgb(path)))
    except FittersError as error:
        raise FittersError(f"{path}: {error}") from None


def read_rgb(path: Path) -> Array:
    """Channels R, G, B (rows, 2 rows, 3) float32 of the first image in a file."""
    image = oiio.ImageInput.open(str(path))
    if image is None:
        raise FittersError(f"cannot be read as an image ({oiio.geterror()}); give an intact .hdr or .exr file")
    try:
        channels = _check_header(image)
        pixels = image.read_image(0, 0, 0, image.spec().nchannels, oiio.FLOAT)
        if pixels is None:
            raise FittersError(f"is cut short or damaged ({image.geterror()}); fetch it again")
        return pixels[..., channels]
    finally:
        image.close()


def _check_header(image: Any) -> list[int]:
    """Indices of R, G and B in an image whose header describes a map."""
    spec = image.spec()
    if image.format_name() not in FORMATS:
        raise FittersError(f"is a {image.format_name()} image, which holds no linear radiance; give .hdr or .exr")
    if spec.width != 2 * spec.height:
        raise FittersError(
            f"has {spec.width} x {spec.height} pixels; a latitude-longitude map is twice as wide as high"
        )
    if spec.height > MAX_ROWS:
        raise FittersError(f"has {spec.height} rows; scale it down to {MAX_ROWS} or fewer")
    if (spec.full_width, spec.full_height) != (spec.width, spec.height):
        raise FittersError("holds a crop of a larger image; save it with its full display window")
    if spec.get_int_attribute("Orientation", 1) != 1:
        raise FittersError("is stored turned or flipped; save it upright (oiiotool IN --reorient -o OUT)")
    names = list(spec.channelnames)
    if not {"R", "G", "B"} <= set(names):
        raise FittersError(f"has the channels {', '.join(names)}; a light needs R, G and B")
    return [names.index(name) for name in "RGB"]


def clean(pixels: Array) -> Array:
    """Pixels as float64, negligible negative values set to 0.

    Raises `FittersError` for other negative values, NaN and infinity.
    """
    radiance = pixels.astype(np.float64)
    infinite = int(np.count_nonzero(~np.isfinite(radiance)))
    if infinite:
        raise FittersError(f"{infinite} of {radiance.size} values are NaN or infinite; repair the map")
    significant = int(np.count_nonzero(radiance < -NEGLIGIBLE * abs(radiance.mean())))
    if significant:
        raise FittersError(
            f"{significant} of {radiance.size} values are negative, down to {radiance.min():.3g}; clamp them to 0"
        )
    return np.maximum(radiance, 0.0, out=radiance)
