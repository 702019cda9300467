"""Lights: two built-in ones that need no file, and image files."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from fitters.grid import Array
from fitters.scenes.environment import EnvironmentMap, texel_angles
from fitters.scenes.images import read_map

ROWS = 256


def load_light(light: str, *, base: Path | None = None) -> EnvironmentMap:
    """The map of a built-in light, or of an image file; a relative path counts from `base`.

    Raises `FittersError` for a file that is not a latitude-longitude map.
    """
    if light in BUILT_IN:
        return BUILT_IN[light](ROWS)
    return read_map((base or Path()) / os.path.expanduser(light))


def studio(rows: int) -> EnvironmentMap:
    """A warm soft box up and left of the camera, a cool strip behind the sphere, a dim bluish backdrop."""
    theta, phi = texel_angles(rows)
    directions = EnvironmentMap(np.ones((rows, 2 * rows, 3))).directions()
    height = np.broadcast_to((1 + np.cos(theta)[:, None]) / 2, (rows, phi.size))
    key = _soft_box(directions, centre=(-0.6, 0.6, 0.6), half_width=0.40, half_height=0.30, softness=0.12)
    rim = _soft_box(directions, centre=(0.85, 0.2, -0.45), half_width=0.08, half_height=0.50, softness=0.04)
    return EnvironmentMap(
        key[..., None] * [24.0, 21.5, 18.5]
        + rim[..., None] * [27.0, 31.0, 36.0]
        + (0.03 + 0.15 * height[..., None] ** 2) * [0.85, 0.95, 1.2]
    )


def overcast(rows: int) -> EnvironmentMap:
    """The CIE standard overcast sky, 1 at the zenith, over ground of albedo 0.2 (Moon and Spencer 1942).

    The sky's horizontal irradiance is 7 pi / 9, hence the ground's radiance.
    """
    theta, phi = texel_angles(rows)
    sky = (1 + 2 * np.cos(theta)) / 3
    ground = 7 / 9 * np.array([0.23, 0.20, 0.16])
    column = np.where(theta[:, None] < np.pi / 2, sky[:, None], ground)
    return EnvironmentMap(np.repeat(column[:, None, :], phi.size, axis=1))


def _soft_box(
    directions: Array,
    *,
    centre: tuple[float, float, float],
    half_width: float,
    half_height: float,
    softness: float,
) -> Array:
    """Coverage (...) in [0, 1] of a rectangle upright at unit distance, its sizes tangents of angles."""
    axis = np.array(centre) / np.linalg.norm(centre)
    right = np.cross([0.0, 1.0, 0.0], axis)
    right /= np.linalg.norm(right)
    up = np.cross(axis, right)
    depth = directions @ axis
    distance = np.maximum(depth, 1e-9)
    across = _fade(np.abs(directions @ right) / distance, half_width, softness)
    along = _fade(np.abs(directions @ up) / distance, half_height, softness)
    return np.where(depth > 0, across * along, 0.0)


def _fade(distance: Array, edge: float, softness: float) -> Array:
    t = np.clip((edge + softness - distance) / (2 * softness), 0.0, 1.0)
    return t * t * (3 - 2 * t)


BUILT_IN: Mapping[str, Callable[[int], EnvironmentMap]] = {"studio": studio, "overcast": overcast}
