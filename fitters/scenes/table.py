"""The light table of a scene (Brady et al. 2014, section 3.5), kept on disk by content hash."""

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fitters import cache
from fitters.errors import FittersError
from fitters.grid import SHAPE, Array
from fitters.scenes.geometries import load_geometry, load_points
from fitters.scenes.lights import load_light
from fitters.scenes.sampled import TOLERANCE, sampled_table
from fitters.scenes.scene import SPHERE, Scene
from fitters.scenes.sphere import RINGS, sphere_light, sphere_table

VERSION = 2
"""Part of the content hash: raise it whenever the same light and scene would give another table."""


@dataclass(frozen=True, eq=False)
class LightTable:
    """Light that a render of a scene carries through each cell with BRDF 1 sr^-1, the mean over its pixels.

    The dot product of `table` and a BRDF, both (3, 90, 90, 180), is the mean colour of the image. Raises
    `FittersError` unless the arrays fit each other and some cell is lit.
    """

    table: Array
    """(3, 90, 90, 180) float32, finite, >= 0: sums of L cos(theta_i) d omega per pixel."""
    lit: NDArray[np.bool_]
    """(90, 90, 180): cells that carry light in some channel."""
    sha256: str
    """Content hash (32 hexadecimal digits) of the light and the numbers that made the table."""
    distance: float = 0.0
    """Relative L2 distance from the limit of more and more samples; 0 for a closed form."""

    @property
    def converged(self) -> bool:
        return self.distance <= TOLERANCE

    @property
    def exactness(self) -> str:
        """Its distance from the limit, in words."""
        if self.distance == 0:
            return "in closed form"
        return f"sampled, {100 * self.distance:.1f} % from its limit (relative L2)"

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
    """The light table of a scene, made once and then kept in the disk cache; relative paths count from `base`.

    In closed form for the sphere, which takes a second or two; by sampling for other geometries, which takes up to
    some minutes and leaves a `distance`. Deterministic: equal light, geometry and numbers give equal bits. Raises
    `FittersError` for a bad file.
    """
    light = load_light(scene.light, base=base)
    turn = float(scene.rotation % 360)
    if scene.geometry == SPHERE:
        key = cache.digest("light table", VERSION, light.radiance, turn)
    else:
        geometry, points = load_geometry(scene, base=base), load_points(scene, base=base)
        key = cache.digest(
            "light table", VERSION, light.radiance, turn, scene.light_rows, geometry.sha256, points.sha256
        )

    def build() -> dict[str, np.ndarray]:
        if scene.geometry == SPHERE:
            table, distance = sphere_light(light, degrees=turn), 0.0
        else:
            table, distance = sampled_table(light.rotated(turn), points, geometry, scene.light_rows)
        return {"table": table.astype(np.float32), "distance": np.array(distance)}

    built = cache.arrays("light", key, build)
    table, distance = built["table"], float(built["distance"])
    lit = np.any(table > 0, axis=0)
    for array in (table, lit):
        array.flags.writeable = False
    return LightTable(table, lit, key, distance)


@functools.cache
def uniform_light() -> LightTable:
    """The light table of radiance 1 from every direction, over a sphere.

    The sum over all cells is pi, which a white surface reflects.
    """
    edges = np.cos(np.arange(RINGS * SHAPE[1] + 1) / (RINGS * SHAPE[1]) * np.pi)
    rings = 2.0 * np.pi * -np.diff(edges)
    table = sphere_table(np.repeat(rings[:, None], 3, axis=1)).astype(np.float32)
    return LightTable(table, table[0] > 0, cache.digest("uniform light"))
