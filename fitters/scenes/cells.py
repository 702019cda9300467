"""Compiled code that finds the cell of two directions on the grid of `fitters.grid`."""

import math

from numba import njit

from fitters.grid import SHAPE, Array


@njit
def cell_of(normal: Array, w_i: Array, w_o: Array, cos_i: float) -> int:
    """The cell of unit directions about a normal, all (3,) in world space; cos_i = normal . w_i."""
    x, y, z = w_i[0] + w_o[0], w_i[1] + w_o[1], w_i[2] + w_o[2]
    length = max(math.sqrt(x * x + y * y + z * z), 1e-300)
    x, y, z = x / length, y / length, z / length
    cos_diff = 0.5 * length
    cos_half = normal[0] * x + normal[1] * y + normal[2] * z
    across = (
        normal[0] * (y * w_i[2] - z * w_i[1])
        + normal[1] * (z * w_i[0] - x * w_i[2])
        + normal[2] * (x * w_i[1] - y * w_i[0])
    )
    theta_half = math.acos(max(min(cos_half, 1.0), 0.0))
    half_bin = min(int(math.sqrt(theta_half / (math.pi / 2)) * SHAPE[0]), SHAPE[0] - 1)
    return cell_index(half_bin, cos_diff, math.atan2(across, cos_diff * cos_half - cos_i))


@njit
def cell_index(half_bin: int, cos_diff: float, phi_diff: float) -> int:
    """As `fitters.grid.cell_index` for a known bin of theta_half; phi_diff in [-pi, pi] is taken modulo pi."""
    diff_bin = min(int(math.acos(min(cos_diff, 1.0)) / (math.pi / 2) * SHAPE[1]), SHAPE[1] - 1)
    if phi_diff < 0.0:
        phi_diff += math.pi
    # Both 0 and pi belong to the first bin.
    phi_bin = int(phi_diff / math.pi * SHAPE[2]) % SHAPE[2]
    return (half_bin * SHAPE[1] + diff_bin) * SHAPE[2] + phi_bin


@njit
def frame_about(normal: Array) -> tuple[Array, Array]:
    """Two unit vectors (3,) that make a right-handed frame with a unit normal (Duff et al. 2017)."""
    x, y, z = normal
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    first, second = normal.copy(), normal.copy()
    first[0], first[1], first[2] = 1.0 + sign * x * x * a, sign * b, -sign * x
    second[0], second[1], second[2] = b, sign + y * y * a, -y
    return first, second


@njit
def texel_of(direction: Array, rows: int) -> int:
    """The index, row by row, of the texel of a unit direction (3,) in a map of `rows` x 2 `rows` texels."""
    theta = math.acos(max(min(direction[1], 1.0), -1.0))
    phi = math.atan2(direction[0], -direction[2])
    if phi < 0.0:
        phi += 2.0 * math.pi
    row = min(int(theta / math.pi * rows), rows - 1)
    return row * 2 * rows + min(int(phi / math.pi * rows), 2 * rows - 1)
