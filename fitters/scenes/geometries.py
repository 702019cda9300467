"""The geometry of a scene: the built-in sphere, or what the camera of a scene file sees."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from fitters import cache
from fitters.errors import FittersError
from fitters.scenes.environment import texel_directions
from fitters.scenes.geometry import Geometry, sphere
from fitters.scenes.mitsuba_scene import mitsuba_geometry
from fitters.scenes.scene import SPHERE, Scene
from fitters.scenes.scene_files import content_sha256

VERSION = 2
"""Part of the content hash: raise it whenever the same file would give another geometry."""


POINTS = 512
"""The least number of points across an image over which the light on a surface is added up."""


def load_points(scene: Scene, *, base: Path | None = None) -> Geometry:
    """The surface in an image of at least `POINTS` pixels across, without shadows.

    This takes about two seconds for a surface that fills the image, and is then kept in the disk cache.
    Raises `FittersError` as `load_geometry` does.
    """
    finer = -(-POINTS // scene.resolution) * scene.resolution
    return load_geometry(replace(scene, resolution=finer, shadows=False), base=base)


def load_geometry(scene: Scene, *, base: Path | None = None) -> Geometry:
    """The geometry of a scene; a scene file is read once and then kept in the disk cache.

    A relative path counts from `base`. With shadows, visibility takes 2 to 4 s for a million pairs of a pixel and
    a texel above its horizon: half a minute for 64 x 64 pixels that the surface fills. Raises `FittersError` for a
    bad file.
    """
    if scene.geometry == SPHERE:
        return sphere(scene.resolution)
    path = (base or Path()) / os.path.expanduser(scene.geometry)
    if not path.is_file():
        raise FittersError(f"{path}: no such scene file; check the path of the geometry")
    rows = scene.light_rows if scene.shadows else 0
    key = cache.digest("geometry", VERSION, content_sha256(path), scene.resolution, scene.shape or "", rows)
    texels = 2 * rows**2

    def build() -> dict[str, np.ndarray]:
        towards = texel_directions(rows).reshape(-1, 3) if rows else None
        reach = 0.71 * np.pi / rows if rows else 0.0
        geometry = mitsuba_geometry(path, scene.resolution, shape=scene.shape, towards=towards, spread=reach)
        visible = geometry.visible
        if visible is None:
            visible = np.zeros((len(geometry.pixels), 0), bool)
        return {
            "normals": geometry.normals,
            "views": geometry.views,
            "pixels": geometry.pixels,
            "shape": np.array(geometry.shape),
            "visible": np.packbits(visible, axis=1),
        }

    arrays = cache.arrays("geometry", key, build)
    rows_seen, columns_seen = arrays["shape"].tolist()
    visible = np.unpackbits(arrays["visible"], axis=1, count=texels).astype(bool) if rows else None
    return Geometry(arrays["normals"], arrays["views"], arrays["pixels"], (rows_seen, columns_seen), visible)
