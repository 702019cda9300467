"""Compiled look-ups that the two tabulated models share: where a direction lies in a table, and what is there.

A `scale` is (alpha_x, alpha_y) of eq. 9: the table holds the slopes of a surface that it stretches.
"""

import math

from numba import njit

from fitters.grid import Array

QUARTER = math.pi / 2


@njit(error_model="numpy")
def lit(w_i: Array, w_o: Array) -> bool:
    """Whether both directions lie above the horizon; a NaN in one is no direction and finds no table's entry."""
    return w_i[2] > 0.0 and w_o[2] > 0.0 and math.isfinite(w_i[0] + w_i[1] + w_o[0] + w_o[1])


@njit(error_model="numpy")
def half_vector(w_i: Array, w_o: Array) -> tuple[float, float, float, float]:
    """The unit half vector, on the upper side, and cos(theta_d)."""
    x, y, z = w_i[0] + w_o[0], w_i[1] + w_o[1], w_i[2] + w_o[2]
    length = math.sqrt(x * x + y * y + z * z)
    # A NaN takes this way too.
    if not length >= 1e-12:
        return 0.0, 0.0, 1.0, 0.0
    if z < 0.0:
        x, y, z = -x, -y, -z
    return x / length, y / length, z / length, min(0.5 * length, 1.0)


@njit(error_model="numpy")
def segment(squared_slope: float, per_unit: float, offset: float, count: int) -> tuple[int, float]:
    """The segment of the radial table that a slope lies in, and its t = log(1 + slope^2).

    `per_unit` nodes lie in a unit of u = sqrt(2 theta / pi), the first at `offset` of their distance.
    """
    u = math.sqrt(math.atan(math.sqrt(squared_slope)) / QUARTER)
    return min(int(u * per_unit + 1.0 - offset), count - 1), math.log1p(squared_slope)


@njit(error_model="numpy")
def linear(position: float, count: int) -> tuple[int, float]:
    """The node before a position among `count`, and the share of the way to the next; the end nodes extend."""
    position = min(max(position, 0.0), count - 1.0)
    node = min(int(position), count - 2)
    return node, position - node


@njit(error_model="numpy")
def times_fresnel(ideal: float, table: Array, cos_d: float, offset: float, values: Array) -> None:
    """`ideal` times F of each channel into values (3,).

    `table` (n, 3) is linear in theta_d, the first node at `offset` of the nodes' distance.
    """
    count = table.shape[0]
    position = math.acos(cos_d) / QUARTER * (count - 1 + 2 * offset) - offset
    node, share = linear(position, count)
    for channel in range(3):
        values[channel] = ideal * ((1 - share) * table[node, channel] + share * table[node + 1, channel])


@njit(error_model="numpy")
def stretched(w: Array, scale: Array) -> tuple[float, float, float, float]:
    """A direction seen by the surface before it was stretched: unit x, y, z, and the length before that."""
    x, y, z = w[0] * scale[0], w[1] * scale[1], w[2]
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length, length


@njit(error_model="numpy")
def reflect(x_slope: float, y_slope: float, w_o: Array, w_i: Array) -> None:
    """Set `w_i` to the mirror direction of `w_o` at the normal (-x_slope, -y_slope, 1)."""
    length = math.sqrt(x_slope * x_slope + y_slope * y_slope + 1.0)
    x, y, z = -x_slope / length, -y_slope / length, 1.0 / length
    twice = 2 * (w_o[0] * x + w_o[1] * y + w_o[2] * z)
    w_i[0], w_i[1], w_i[2] = twice * x - w_o[0], twice * y - w_o[1], twice * z - w_o[2]
