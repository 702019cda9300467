"""The light table of a scene (Brady et al. 2014, section 3.5), kept on disk by content hash."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fitters import cache
from fitters.errors import FittersError
from fitters.grid import SHAPE, Array
from fitters.scenes.geometries import load_geometry
from fitters.scenes.kernel import integrate, integrate_seen, sphere_normals
from fitters.scenes.lights import load_light
from fitters.scenes.scene import SPHERE, Scene

VERSION = 1
"""Part of the content hash: raise it whenever the same light and scene would give another table."""


@dataclass(frozen=True, eq=False)
class LightTable:
    """Light that a render of a scene carries through each cell with BRDF 1 sr^-1, the mean over its pixels.

    The dot product of `table` and a BRDF, both (3, 90, 90, 180), is the mean colour of the sphere. Raises
    `FittersError` unless the arrays fit each other and some cell is lit.
    """

    table: Array
    """(3, 90, 90, 180) float32, finite, >= 0: sums of L cos(theta_i) d omega per pixel."""
    lit: NDArray[np.bool_]
    """(90, 90, 180): cells that carry light in some channel."""
    sha256: str
    """Content hash (32 hexadecimal digits) of the light and the numbers that made the table."""

    def __post_init__(self) -> None:
        if self.table.shape != (3, *SHAPE) or self.table.dtype != np.float32:
            raise FittersError(
                f"light table: {self.table.dtype} {self.table.shape} is not float32 (3, 90, 90, 180)"
            )
        if not (np.isfinite(self.table).all() and (self.table >= 0).all()):
            raise FittersError("light table: some values are negative or not finite")
        if not np.array_equal(self.lit, (self.table > 0).any(axis=0)):
            raise FittersError("light table: `lit` is not where the table is positive")
        if not self.lit.any():
            raise FittersError("light table: no light reaches what the camera sees; rotate the light")


def light_table(scene: Scene, *, base: Path | None = None) -> LightTable:
    """The light table of a scene, from the disk cache where it is there; relative paths are found in `base`.

    Deterministic: the same light, geometry and numbers give the same bits. Raises `FittersError` for a bad file.
    """
    light = load_light(scene.light, base=base)
    turn = float(scene.rotation % 360)
    numbers = (light.radiance, turn, scene.resolution, scene.light_rows)
    # The sphere has a kernel of its own, several times as fast, which makes use of its single view.
    if scene.geometry == SPHERE:
        key = cache.digest("light table", VERSION, *numbers)
    else:
        geometry = load_geometry(scene, base=base)
        key = cache.digest("light table", VERSION, *numbers, geometry.sha256)

    def build() -> dict[str, np.ndarray]:
        reduced = light.resampled(scene.light_rows, turn)
        if scene.geometry == SPHERE:
            table = integrate(reduced, sphere_normals(scene.resolution))
        else:
            table = integrate_seen(reduced, geometry.normals, geometry.views, geometry.visible)
        return {"table": table.astype(np.float32)}

    table = cache.arrays("light", key, build)["table"]
    lit = np.any(table > 0, axis=0)
    for array in (table, lit):
        array.flags.writeable = False
    return LightTable(table, lit, key)
