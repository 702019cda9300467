"""The recipe of a scene."""

import math
from dataclasses import dataclass

from fitters.errors import FittersError


@dataclass(frozen=True)
class Scene:
    """A sphere under an environment map, seen by an orthographic camera; small, hashable, travels anywhere.

    The camera looks along -z with +y up, so that w_o = (0, 0, 1) at every pixel. Raises `FittersError` for
    numbers out of range.
    """

    light: str = "studio"
    """A built-in light, `studio` or `overcast`, or the path of a .hdr or .exr latitude-longitude map."""
    rotation: float = 0.0
    """Degrees by which the light turns about +y, right-handed: light behind the camera moves to its right."""
    resolution: int = 64
    """Pixels across the image of the sphere, 1 to 1024."""
    light_rows: int = 48
    """The map is resampled to `light_rows` x 2 `light_rows` texels, 2 to 1024."""

    def __post_init__(self) -> None:
        if not isinstance(self.light, str) or not self.light:
            raise FittersError(f"light: {self.light!r} is neither a built-in light nor the path of a map")
        if not math.isfinite(self.rotation):
            raise FittersError(f"rotation: {self.rotation} is not an angle; give finite degrees")
        _check_count("resolution", self.resolution, 1, 1024)
        _check_count("light_rows", self.light_rows, 2, 1024)


def _check_count(name: str, value: int, lowest: int, highest: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not lowest <= value <= highest:
        raise FittersError(f"{name}: {value!r} is not a whole number from {lowest} to {highest}")
