"""The half/difference grid of Rusinkiewicz (1998) that every material is held on, phi_half = 0.

A cell is addressed by (theta_half, theta_diff, phi_diff) bins of shape `SHAPE`, or by its flat index
`phi_diff + 180 (theta_diff + 90 theta_half)`, as in the MERL files. theta_half bins are i^2/90 to (i+1)^2/90
degrees, the two others one degree; phi_diff is taken modulo pi by reciprocity. All angles are radians.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

SHAPE = (90, 90, 180)
CELLS = SHAPE[0] * SHAPE[1] * SHAPE[2]
CHANNELS = ("red", "green", "blue")


def bin_centres() -> tuple[Array, Array, Array]:
    """Centres of the bins: theta_half (90,), theta_diff (90,), phi_diff (180,)."""
    theta_half = ((np.arange(SHAPE[0]) + 0.5) / SHAPE[0]) ** 2 * (np.pi / 2)
    theta_diff = (np.arange(SHAPE[1]) + 0.5) / SHAPE[1] * (np.pi / 2)
    phi_diff = (np.arange(SHAPE[2]) + 0.5) / SHAPE[2] * np.pi
    return theta_half, theta_diff, phi_diff


def directions(theta_half: Array, theta_diff: Array, phi_diff: Array) -> tuple[Array, Array]:
    """Unit w_i and w_o (..., 3) for half/difference angles; the normal is +z, the half vector lies in x-z."""
    sin_h, cos_h = np.sin(theta_half), np.cos(theta_half)
    sin_d, cos_d = np.sin(theta_diff), np.cos(theta_diff)
    x, y = sin_d * np.cos(phi_diff), sin_d * np.sin(phi_diff)
    w_i = np.stack(np.broadcast_arrays(cos_h * x + sin_h * cos_d, y, cos_h * cos_d - sin_h * x), axis=-1)
    w_o = np.stack(np.broadcast_arrays(-cos_h * x + sin_h * cos_d, -y, cos_h * cos_d + sin_h * x), axis=-1)
    return w_i, w_o


def half_diff(w_i: Array, w_o: Array) -> tuple[Array, Array, Array]:
    """theta_half, theta_diff, phi_diff (...) of unit directions (..., 3); phi_diff in [0, pi) by reciprocity."""
    half = w_i + w_o
    half = half / np.linalg.norm(half, axis=-1, keepdims=True)
    theta_half = np.arctan2(np.hypot(half[..., 0], half[..., 1]), half[..., 2])
    cos_d = np.clip(np.sum(w_i * half, axis=-1), -1.0, 1.0)
    # The tangent frame at the half vector: t points away from the normal, b completes it.
    sin_h = np.hypot(half[..., 0], half[..., 1])
    safe = np.where(sin_h > 1e-12, sin_h, 1.0)
    cos_phi = np.where(sin_h > 1e-12, half[..., 0] / safe, 1.0)
    sin_phi = np.where(sin_h > 1e-12, half[..., 1] / safe, 0.0)
    t = np.stack([half[..., 2] * cos_phi, half[..., 2] * sin_phi, -sin_h], axis=-1)
    b = np.stack([-sin_phi, cos_phi, np.zeros_like(sin_phi)], axis=-1)
    x, y = np.sum(w_i * t, axis=-1), np.sum(w_i * b, axis=-1)
    theta_diff = np.arctan2(np.hypot(x, y), cos_d)
    phi_diff = np.mod(np.arctan2(y, x), np.pi)
    return theta_half, theta_diff, phi_diff


def cell_index(theta_half: Array, theta_diff: Array, phi_diff: Array) -> NDArray[np.int64]:
    """Flat cell index (...) of half/difference angles, truncated to the bin as the field's readers do."""
    i = np.sqrt(np.clip(theta_half, 0, None) / (np.pi / 2)) * SHAPE[0]
    j = theta_diff / (np.pi / 2) * SHAPE[1]
    k = np.mod(phi_diff, np.pi) / np.pi * SHAPE[2]
    bins = [np.clip(x.astype(np.int64), 0, n - 1) for x, n in zip((i, j, k), SHAPE, strict=True)]
    return (bins[0] * SHAPE[1] + bins[1]) * SHAPE[2] + bins[2]


@cache
def cell_directions() -> tuple[Array, Array]:
    """Unit w_i and w_o (CELLS, 3) at the centres of all cells, in flat order."""
    angles = np.meshgrid(*bin_centres(), indexing="ij")
    w_i, w_o = directions(*(a.ravel() for a in angles))
    return w_i, w_o


@cache
def above_horizon() -> NDArray[np.bool_]:
    """(90, 90, 180): cells whose centre has both directions strictly above the surface."""
    w_i, w_o = cell_directions()
    return ((w_i[:, 2] > 0) & (w_o[:, 2] > 0)).reshape(SHAPE)
