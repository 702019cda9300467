"""The recipe of a scene."""

import math
from dataclasses import dataclass

from fitters.errors import FittersError

SPHERE = "sphere"
"""The built-in geometry."""


@dataclass(frozen=True)
class Scene:
    """A surface under an environment map, seen by a camera; small, hashable and cheap to send to a process.

    The built-in sphere's camera is orthographic and looks along -z with +y up, so that w_o = (0, 0, 1) at every
    pixel. Raises `FittersError` for numbers out of range.
    """

    light: str = "studio"
    """A built-in light, `studio` or `overcast`, or the path of a .hdr or .exr latitude-longitude map."""
    rotation: float = 0.0
    """Degrees by which the light is turned about +y, right-handed: light behind the camera moves to its right."""
    resolution: int = 64
    """Pixels across the image, 1 to 1024; the light table of the sphere does not depend on it."""
    light_rows: int = 48
    """Of a scene file: shadows are found for `light_rows` x 2 `light_rows` directions, 2 to 1024."""
    geometry: str = SPHERE
    """`sphere`, or the path of a Mitsuba scene file (.xml) whose camera and shapes are taken, +y being up."""
    shape: str | None = None
    """Of a scene file: the id of the only shape that has the material; None for all."""
    shadows: bool = True
    """Of a scene file: whether its shapes hide the light from each other."""

    def __post_init__(self) -> None:
        if not isinstance(self.light, str) or not self.light:
            raise FittersError(f"light: {self.light!r} is neither a built-in light nor the path of a map")
        if not isinstance(self.geometry, str) or not self.geometry:
            raise FittersError(f"geometry: {self.geometry!r} is neither {SPHERE} nor the path of a scene file")
        if not math.isfinite(self.rotation):
            raise FittersError(f"rotation: {self.rotation} is not an angle; give finite degrees")
        _check_count("resolution", self.resolution, 1, 1024)
        _check_count("light_rows", self.light_rows, 2, 1024)


def _check_count(name: str, value: int, lowest: int, highest: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not lowest <= value <= highest:
        raise FittersError(f"{name}: {value!r} is not a whole number from {lowest} to {highest}")
