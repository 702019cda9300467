"""The geometry that a scene names: the built-in sphere, else what the camera of a scene file sees."""

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
"""So many points across an image, at least, stand for the surface where light is added up over all of it."""


def load_points(scene: Scene, *, base: Path | None = None) -> Geometry:
    """The surface as `POINTS` x `POINTS` pixels would show it, or as many as the scene has; without shadows.

    Some two seconds for a surface that fills the image, then from the disk cache. Errors as `load_geometry`.
    """
    finer = -(-POINTS // scene.resolution) * scene.resolution
    return load_geometry(replace(scene, resolution=finer, shadows=False), base=base)


def load_geometry(scene: Scene, *, base: Path | None = None) -> Geometry:
    """The geometry of a scene, of a file from the disk cache where it is there; found in `base` where relative.

    With shadows, finding what each point sees takes 2 to 4 s for a million pairs of a pixel and a texel above its
    horizon: half a minute for 64 x 64 pixels that the surface fills. Raises `FittersError` for a bad file.
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
        found = mitsuba_geometry(path, scene.resolution, shape=scene.shape, towards=towards, spread=reach)
        visible = np.zeros((len(found.pixels), 0), bool) if found.visible is None else found.visible
        return {
            "normals": found.normals,
            "views": found.views,
            "pixels": found.pixels,
            "shape": np.array(found.shape),
            "visible": np.packbits(visible, axis=1),
        }

    arrays = cache.arrays("geometry", key, build)
    rows_seen, columns_seen = arrays["shape"].tolist()
    visible = np.unpackbits(arrays["visible"], axis=1, count=texels).astype(bool) if rows else None
    return Geometry(arrays["normals"], arrays["views"], arrays["pixels"], (rows_seen, columns_seen), visible)
