"""Geometry from Mitsuba 3 scene files: what the camera of a scene sees, and which light each point sees."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fitters.errors import FittersError
from fitters.grid import Array
from fitters.scenes.geometry import DISC, Geometry

VARIANT = "scalar_rgb"
"""It needs no LLVM: with some versions of LLVM Mitsuba ends the process."""

FACING = (1 - DISC) ** 0.5
"""A pixel belongs to the surface if the cosine of its normal and its view is larger, as on the built-in sphere."""


class _Hit(NamedTuple):
    """What the ray of a pixel (flat index) hits."""

    pixel: int
    normal: Array
    view: Array
    interaction: Any


def mitsuba_geometry(
    path: Path, resolution: int, *, shape: str | None = None, towards: Array | None = None, spread: float = 0.0
) -> Geometry:
    """What the first camera of a Mitsuba scene file sees, one ray through each pixel's centre.

    The image is `resolution` pixels wide and as high as the film's aspect ratio says. `shape` is the id of the
    only shape to look at; the others hide it and cast shadows. `towards` (texels, 3) are unit directions for which
    visibility is computed, each representing those within `spread` radians; without it nothing casts a shadow.

    Positions, interpolated ("shading") normals and occlusion are the scene's; its materials, lights, bump maps
    and masks are ignored. World space is that of the environment map: +y is up. Surfaces have two sides: a normal
    is turned to the side that the camera sees. Pixels where the cosine of normal and view is still below `FACING`
    are left out.

    Raises `FittersError` where Mitsuba or a file is missing, or the scene shows no surface.
    """
    with _mitsuba(path) as mi:
        scene = _loaded(mi, path)
        _check_shape(scene, path, shape)
        size = _image_size(scene, resolution)
        hits = list(_hits(scene, size, shape))
        if not hits:
            raise FittersError(f"{path}: no pixel shows {shape or 'a shape'}; move the camera")
        normals = np.array([hit.normal for hit in hits])
        views = np.array([hit.view for hit in hits])
        pixels = np.array([hit.pixel for hit in hits])
        visible = None if towards is None else _visibility(mi, scene, hits, towards, spread)
        return Geometry(normals, views, pixels, size, visible)


@contextmanager
def _mitsuba(path: Path) -> Iterator[Any]:
    """Mitsuba with the variant used here, without messages; variant and log level are restored afterwards."""
    try:
        import mitsuba as mi
    except ImportError:
        raise FittersError(f"{path}: scene files need Mitsuba 3: pip install 'gpsearch[mitsuba]'") from None
    before = mi.variant()
    mi.set_variant(VARIANT)
    level = mi.log_level()
    mi.set_log_level(mi.LogLevel.Error)
    try:
        yield mi
    finally:
        mi.set_log_level(level)
        if before:
            mi.set_variant(before)


def _loaded(mi: Any, path: Path) -> Any:
    if not path.is_file():
        raise FittersError(f"{path}: no such scene file; check the path")
    try:
        # Unoptimised: merged shapes would lose their ids.
        scene = mi.load_file(str(path), parallel=False, optimize=False)
    except Exception as error:
        reason = " ".join(str(error).split())
        raise FittersError(f"{path}: Mitsuba cannot load it ({reason}); repair the scene file") from None
    if not isinstance(scene, mi.Scene):
        raise FittersError(f"{path}: holds {type(scene).__name__}, not a scene; wrap it in <scene>")
    if not scene.sensors():
        raise FittersError(f"{path}: has no <sensor>; add the camera that is to look at the surface")
    return scene


def _check_shape(scene: Any, path: Path, shape: str | None) -> None:
    known = sorted(one.id() for one in scene.shapes())
    if shape is not None and shape not in known:
        raise FittersError(f"{path}: has no shape of id {shape!r}; there are {', '.join(known) or 'none'}")


def _image_size(scene: Any, resolution: int) -> tuple[int, int]:
    width, height = scene.sensors()[0].film().crop_size()
    return max(round(resolution * height / width), 1), resolution


def _hits(scene: Any, size: tuple[int, int], shape: str | None) -> Iterator[_Hit]:
    """The pixels that show the surface, row by row from the top."""
    sensor, (rows, columns) = scene.sensors()[0], size
    for pixel in range(rows * columns):
        row, column = divmod(pixel, columns)
        centre = [(column + 0.5) / columns, (row + 0.5) / rows]
        ray, _ = sensor.sample_ray(sensor.shutter_open(), 0.5, centre, [0.5, 0.5])
        interaction = scene.ray_intersect(ray)
        if not interaction.is_valid() or (shape is not None and interaction.shape.id() != shape):
            continue
        view = -_unit(ray.d)
        side = 1.0 if _unit(interaction.n) @ view >= 0 else -1.0
        normal = side * _unit(interaction.sh_frame.n)
        if normal @ view > FACING:
            yield _Hit(pixel, normal, view, interaction)


def _visibility(mi: Any, scene: Any, hits: list[_Hit], towards: Array, spread: float) -> NDArray[np.bool_]:
    """(p, texels): which directions above the horizon of its normal reach the sky from each point.

    A direction that represents light on both sides of the horizon is moved to the part above it.
    """
    visible = np.zeros((len(hits), len(towards)), bool)
    for seen, hit in zip(visible, hits, strict=True):
        cosines = towards @ hit.normal
        above = np.flatnonzero(cosines > -spread)
        lift = np.maximum(spread / 2 - cosines[above], 0.0)
        directions = towards[above] + lift[:, None] * hit.normal
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        outside = directions @ _unit(hit.interaction.n) >= 0
        # A ray starts close to the surface, on the side of its direction.
        starts = [hit.interaction.spawn_ray(side * hit.interaction.n) for side in (-1, 1)]
        for texel, direction, out in zip(above.tolist(), directions.tolist(), outside.tolist(), strict=True):
            ray = starts[int(out)]
            ray.d = mi.Vector3f(direction)
            seen[texel] = not scene.ray_test(ray)
    return visible


def _unit(vector: Any) -> Array:
    """A single-precision vector of Mitsuba as a unit vector (3,) float64."""
    components = np.array([vector.x, vector.y, vector.z], np.float64)
    return components / np.linalg.norm(components)
