"""What a camera sees of a surface: the normal, the view and the visible light of every pixel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters import cache
from fitters.errors import FittersError
from fitters.grid import Array

DISC = 0.998
"""Pixels with x^2 + y^2 below this belong to the sphere; those at grazing angles are left out."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """The p pixels of an image that show the surface.

    normals: (p, 3) unit, in world space
    views:   (p, 3) unit directions w_o towards the camera, above the surface
    pixels:  (p,) flat indices into the image, row 0 at the top
    shape:   (rows, columns) of the image
    visible: (p, texels) which texels of the light's reduced map reach the surface, row by row; None where all that
             are above its horizon do

    Raises `FittersError` unless the arrays fit each other and some pixel shows the surface.
    """

    normals: Array
    views: Array
    pixels: NDArray[np.int64]
    shape: tuple[int, int]
    visible: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        count = len(self.pixels)
        if not count:
            raise FittersError("geometry: no pixel shows the surface; move the camera")
        if self.normals.shape != (count, 3) or self.views.shape != (count, 3):
            raise FittersError(
                f"geometry: {count} pixels, normals {self.normals.shape}, views {self.views.shape}: "
                "each pixel needs one of both"
            )
        if self.visible is not None and len(self.visible) != count:
            raise FittersError(f"geometry: {count} pixels, visibility of {len(self.visible)}")

    @property
    def sha256(self) -> str:
        """Content hash (32 hexadecimal digits)."""
        visible = b"" if self.visible is None else self.visible
        return cache.digest("geometry", self.normals, self.views, self.pixels, self.shape, visible)


def sphere(resolution: int) -> Geometry:
    """The unit sphere in a square image that it fills, `resolution` pixels across, seen along -z with +y up.

    Pixels are listed row by row from the bottom.
    """
    axis = (np.arange(resolution) + 0.5) / resolution * 2 - 1
    squared = axis**2 + axis[:, None] ** 2
    row, column = np.nonzero(squared < DISC)
    normals = np.stack([axis[column], axis[row], np.sqrt(1 - squared[row, column])], axis=-1)
    views = np.tile([0.0, 0.0, 1.0], (len(normals), 1))
    pixels = (resolution - 1 - row) * resolution + column
    return Geometry(normals, views, pixels, (resolution, resolution))
