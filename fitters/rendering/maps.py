"""The image of a scene as a linear map from cells to pixels, built once per scene: an image is one product."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fitters import cache, compiled
from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, Array, cell_directions
from fitters.materials import Material
from fitters.rendering.kernel import AZIMUTHS, BLOCK, SPREAD, STEPS, pixel_rows
from fitters.rendering.picture import Picture
from fitters.rendering.shared_exponent import STEPS as MANTISSA_STEPS
from fitters.rendering.shared_exponent import unpacked
from fitters.scenes.environment import EnvironmentMap
from fitters.scenes.geometries import load_geometry
from fitters.scenes.geometry import Geometry
from fitters.scenes.lights import load_light
from fitters.scenes.pyramid import pyramid
from fitters.scenes.scene import Scene

if TYPE_CHECKING:
    from fitters.models import Model

VERSION = 2
"""Part of the content hash: raise it whenever the same scene would give another map."""

CHUNK = 256
"""Pixels that a thread works on at a time."""


@dataclass(frozen=True, eq=False)
class ImageMap:
    """The weight of every cell in every pixel of an image, six bytes for a pixel and a cell.

    cells:    (k,) flat indices of the cells that some pixel sees, rising
    pointers: (90 p + 1,) where the entries of a pixel and a bin of theta_half begin
    codes:    (n,) uint16, the cell of an entry among those of its bin of theta_half
    words:    (n,) uint32, L cos(theta_i) d omega of the light that a pixel sees in a cell, in a packed form
    scales:   (p,) by which the weights of a pixel are multiplied
    pixels:   (p,) flat indices into the image, row 0 at the top
    facing:   (p,) cosines of the angles between a pixel's normal and its view
    shape:    (rows, columns) of the image

    Radiance is linear in the BRDF: L_o = sum over cells of weight times f, at the pixels' centres. Texels of the
    light are constant, and the BRDF is constant in a cell, as a measurement is.
    """

    cells: NDArray[np.int64]
    pointers: NDArray[np.int64]
    codes: NDArray[np.uint16]
    words: NDArray[np.uint32]
    scales: NDArray[np.float32]
    pixels: NDArray[np.int64]
    facing: Array
    shape: tuple[int, int]
    sha256: str

    def row(self, pixel: int) -> tuple[NDArray[np.int64], Array]:
        """Cells (n,), rising, that the pixel at an index of `pixels` sees, and their weights (n, 3)."""
        edges = self.pointers[pixel * SHAPE[0] : (pixel + 1) * SHAPE[0] + 1]
        blocks = np.repeat(np.arange(SHAPE[0]) * BLOCK, np.diff(edges))
        inside = slice(edges[0], edges[-1])
        return blocks + self.codes[inside], unpacked(self.words[inside], float(self.scales[pixel]))

    def radiance(self, values: Array) -> Array:
        """Radiance (p, 3) of the pixels for BRDF values (k, 3) in sr^-1 at `cells`."""
        if values.shape != (len(self.cells), 3):
            raise FittersError(
                f"an image map of {len(self.cells)} cells takes ({len(self.cells)}, 3) values, not {values.shape}"
            )
        everywhere = np.zeros((CELLS, 3), np.float32)
        everywhere[self.cells] = values
        return _product(self.pointers, self.codes, self.words, self.scales, everywhere, MANTISSA_STEPS)

    def picture(self, values: Array) -> Picture:
        """The image for BRDF values (k, 3) at `cells`."""
        pixels, foreground = np.zeros((self.shape[0] * self.shape[1], 3)), np.zeros(self.shape, bool)
        pixels[self.pixels] = self.radiance(values)
        foreground.ravel()[self.pixels] = True
        return Picture(pixels.reshape(*self.shape, 3), foreground)

    def of_material(self, material: Material) -> Picture:
        """The image with a measurement; cells that were not measured are black."""
        return self.picture(material.table.reshape(3, CELLS)[:, self.cells].T)

    def of_model(self, model: "Model", material: Material) -> Picture:
        """The image with a model of a material; cells where the material was not measured are black."""
        values = np.zeros((len(self.cells), 3))
        valid = material.valid.ravel()[self.cells]
        w_i, w_o = cell_directions()
        at = self.cells[valid]
        values[valid] = model.evaluate(w_i[at], w_o[at])
        return self.picture(values)

    def unmeasured(self, material: Material) -> float:
        """The share of the light in a white surface's image from cells where the material was not measured."""
        ones = np.ones((len(self.cells), 3))
        total = self.radiance(ones).sum()
        return 1.0 - float(self.radiance(ones * material.valid.ravel()[self.cells, None]).sum() / total)


def image_map(scene: Scene, *, base: Path | None = None) -> ImageMap:
    """The image map of a scene, made once and then kept in the disk cache; relative paths count from `base`.

    Deterministic. A pixel sees about 8,000 cells, which makes 350 MB for 96 pixels across.
    """
    light = load_light(scene.light, base=base).rotated(float(scene.rotation % 360))
    geometry = load_geometry(scene, base=base)
    key = cache.digest("image map", VERSION, light.radiance, geometry.sha256, scene.light_rows)
    arrays = cache.arrays("image", key, lambda: mapped(light, geometry, scene.light_rows))
    facing = np.sum(geometry.normals * geometry.views, axis=1)
    return ImageMap(**arrays, pixels=geometry.pixels, facing=facing, shape=geometry.shape, sha256=key)


def mapped(
    light: EnvironmentMap,
    geometry: Geometry,
    light_rows: int,
    *,
    steps: int = STEPS,
    azimuths: int = AZIMUTHS,
    spread: float = SPREAD,
) -> dict[str, np.ndarray]:
    """The arrays of an image map by name: `cells`, `pointers`, `codes`, `words`, `scales`.

    The visible light of `geometry` is known at `light_rows` rows. `fitters.rendering.kernel` explains `steps`,
    `azimuths` and `spread`.
    """
    levels = pyramid(light)
    visible = np.ones((1, 1), bool) if geometry.visible is None else geometry.visible

    def chunk(start: int) -> tuple[np.ndarray, ...]:
        part = slice(start, start + CHUNK)
        normals, views = (np.ascontiguousarray(of[part]) for of in (geometry.normals, geometry.views))
        sees = visible if geometry.visible is None else np.ascontiguousarray(visible[part])
        return pixel_rows(
            normals, views, sees, light_rows, levels.texels, levels.centres, levels.rows, levels.starts, steps,
            azimuths, spread,
        )  # fmt: skip

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        parts = list(pool.map(chunk, range(0, len(geometry.pixels), CHUNK)))
    sizes = np.concatenate([np.diff(part[0]) for part in parts])
    pointers = np.concatenate([[0], np.cumsum(sizes)])
    codes, words, scales = (np.concatenate([part[k] for part in parts]) for k in (1, 2, 3))
    return {
        "cells": _seen(pointers, codes),
        "pointers": pointers,
        "codes": codes,
        "words": words,
        "scales": scales,
    }


@compiled.entry()
def _seen(pointers: NDArray[np.int64], codes: NDArray[np.uint16]) -> NDArray[np.int64]:
    """Flat indices of the cells that some pixel sees, rising."""
    occurs = np.zeros(CELLS, np.bool_)
    for block in range(len(pointers) - 1):
        for entry in range(pointers[block], pointers[block + 1]):
            occurs[block % SHAPE[0] * BLOCK + codes[entry]] = True
    return np.flatnonzero(occurs)


@compiled.entry()
def _product(
    pointers: NDArray[np.int64],
    codes: NDArray[np.uint16],
    words: NDArray[np.uint32],
    scales: NDArray[np.float32],
    values: NDArray[np.float32],
    steps: Array,
) -> Array:
    """Radiance (p, 3) for values (CELLS, 3)."""
    radiance = np.zeros((len(scales), 3))
    for block in range(len(pointers) - 1):
        pixel, first = block // SHAPE[0], block % SHAPE[0] * BLOCK
        red, green, blue = 0.0, 0.0, 0.0
        for entry in range(pointers[block], pointers[block + 1]):
            word, cell = words[entry], first + codes[entry]
            step = steps[word >> 27]
            red += (word & 511) * step * values[cell, 0]
            green += (word >> 9 & 511) * step * values[cell, 1]
            blue += (word >> 18 & 511) * step * values[cell, 2]
        radiance[pixel, 0] += red * scales[pixel]
        radiance[pixel, 1] += green * scales[pixel]
        radiance[pixel, 2] += blue * scales[pixel]
    return radiance
