"""The image of a scene as a linear map from cells to pixels: built once per scene, any model is one product."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fitters import cache
from fitters.errors import FittersError
from fitters.grid import CELLS, Array, cell_directions
from fitters.materials import Material
from fitters.models import Model
from fitters.rendering.kernel import rows
from fitters.rendering.picture import Picture
from fitters.scenes.geometries import load_geometry
from fitters.scenes.lights import load_light
from fitters.scenes.scene import Scene

VERSION = 1
"""Part of the content hash: raise it whenever the same scene would give another map."""


@dataclass(frozen=True, eq=False)
class ImageMap:
    """What every pixel of an image sees of every cell.

    cells:    (k,) flat indices of the cells that some pixel sees, rising
    pointers: (p + 1,) where the entries of a pixel begin
    columns:  (n,) indices into `cells`, row by row
    weights:  (n, 3) float32, L cos(theta_i) d omega summed over the light that a pixel sees in a cell
    pixels:   (p,) flat indices into the image, row 0 at the top
    facing:   (p,) cosines of the angles between a pixel's normal and its view
    shape:    (rows, columns) of the image

    Radiance is linear in the BRDF: L_o = sum over cells of weight times f, at the pixels' centres, texels of the
    light being constant. A BRDF is taken as constant in a cell, as a measurement is.
    """

    cells: NDArray[np.int64]
    pointers: NDArray[np.int64]
    columns: NDArray[np.int32]
    weights: NDArray[np.float32]
    pixels: NDArray[np.int64]
    facing: Array
    shape: tuple[int, int]
    sha256: str

    @cached_property
    def _channels(self) -> tuple[csr_array, ...]:
        size = (len(self.pixels), len(self.cells))
        return tuple(
            csr_array((np.ascontiguousarray(self.weights[:, c]), self.columns, self.pointers), shape=size)
            for c in range(3)
        )

    def radiance(self, values: Array) -> Array:
        """Radiance (p, 3) of the pixels for BRDF values (k, 3) in sr^-1 at `cells`."""
        if values.shape != (len(self.cells), 3):
            raise FittersError(
                f"an image map of {len(self.cells)} cells takes ({len(self.cells)}, 3) values, not {values.shape}"
            )
        columns = np.ascontiguousarray(values.T, np.float32)
        return np.stack([m @ column for m, column in zip(self._channels, columns, strict=True)], axis=1).astype(
            float
        )

    def picture(self, values: Array) -> Picture:
        """The image for BRDF values (k, 3) at `cells`."""
        pixels, foreground = np.zeros((self.shape[0] * self.shape[1], 3)), np.zeros(self.shape, bool)
        pixels[self.pixels] = self.radiance(values)
        foreground.ravel()[self.pixels] = True
        return Picture(pixels.reshape(*self.shape, 3), foreground)

    def of_material(self, material: Material) -> Picture:
        """The image with a measurement; cells that were not measured are black."""
        return self.picture(material.table.reshape(3, CELLS)[:, self.cells].T)

    def of_model(self, model: Model, material: Material) -> Picture:
        """The image with a model of a material; as the measurement, black where that has no value."""
        values = np.zeros((len(self.cells), 3))
        valid = material.valid.ravel()[self.cells]
        w_i, w_o = cell_directions()
        at = self.cells[valid]
        values[valid] = model.evaluate(w_i[at], w_o[at])
        return self.picture(values)

    def unmeasured(self, material: Material) -> float:
        """The share of a white surface's image that lies in cells where the material was not measured."""
        ones = np.ones((len(self.cells), 3))
        total = self.radiance(ones).sum()
        return 1.0 - float(self.radiance(ones * material.valid.ravel()[self.cells, None]).sum() / total)


def image_map(scene: Scene, *, base: Path | None = None) -> ImageMap:
    """The image map of a scene, from the disk cache where it is there; relative paths are found in `base`.

    Deterministic. Some 16 bytes for each of 3,000 cells that a pixel sees: 350 MB for 96 pixels across.
    """
    light = load_light(scene.light, base=base).resampled(scene.light_rows, float(scene.rotation % 360))
    geometry = load_geometry(scene, base=base)
    key = cache.digest("image map", VERSION, light.radiance, geometry.sha256)

    def build() -> dict[str, np.ndarray]:
        pointers, cells, weights = rows(light, geometry.normals, geometry.views, geometry.visible)
        used, columns = _compacted(cells)
        return {"cells": used, "pointers": pointers, "columns": columns, "weights": weights}

    arrays = cache.arrays("image", key, build)
    facing = np.sum(geometry.normals * geometry.views, axis=1)
    return ImageMap(**arrays, pixels=geometry.pixels, facing=facing, shape=geometry.shape, sha256=key)


def _compacted(cells: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """The cells that occur, rising, and for each entry its place among them."""
    occurs = np.zeros(CELLS, bool)
    occurs[cells] = True
    places = np.cumsum(occurs, dtype=np.int32) - 1
    return np.flatnonzero(occurs), places[cells]
