"""Bilinear grids, and the warp of the unit square onto itself that a bilinear density defines.

A position (x, y) in [0, 1]^2 addresses the columns and rows of a grid, whose outermost nodes lie on the border.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fitters.grid import Array


class Place(NamedTuple):
    """Places of m values on an axis: the lower node (m,) and the fraction (m,) of the way to the next."""

    node: NDArray[np.int64]
    fraction: Array

    def ends(self) -> tuple[tuple[int, Array], tuple[int, Array]]:
        """Both neighbouring nodes, as (step from the lower node, weight (m,))."""
        return (0, 1.0 - self.fraction), (1, self.fraction)


def between(position: Array, count: int) -> Place:
    """The place of positions in [0, 1] among `count` evenly spaced nodes."""
    scaled = np.clip(position, 0.0, 1.0) * (count - 1)
    node = np.minimum(scaled.astype(np.int64), count - 2)
    return Place(node, scaled - node)


def between_nodes(value: Array, nodes: Array) -> Place:
    """The place of values among increasing `nodes`; values beyond the ends are moved to the outermost node."""
    node = np.clip(np.searchsorted(nodes, value, side="right") - 1, 0, len(nodes) - 2)
    step = nodes[node + 1] - nodes[node]
    return Place(node, np.clip((value - nodes[node]) / step, 0.0, 1.0))


def _corners(x: Array, y: Array, rows: int, columns: int) -> Iterator[tuple[NDArray[np.int64], Array]]:
    """The four nodes around each position: flat index (m,) into a grid (rows, columns) and weight (m,)."""
    row, column = between(y, rows), between(x, columns)
    for down, share_y in row.ends():
        for right, share_x in column.ends():
            yield (row.node + down) * columns + column.node + right, share_y * share_x


def bilinear(grid: Array, x: Array, y: Array) -> Array:
    """Values (m,) of a grid (rows, columns) at m positions."""
    flat = grid.ravel()
    return np.sum([share * flat[index] for index, share in _corners(x, y, *grid.shape)], axis=0)


def trilinear(stack: Array, slices: Place, x: Array, y: Array) -> Array:
    """Values (m, c) of a stack of grids (n, rows, columns, c) at m positions between neighbouring slices."""
    _, rows, columns, channels = stack.shape
    flat = stack.reshape(-1, channels)
    total = np.zeros((len(x), channels))
    for index, share in _corners(x, y, rows, columns):
        for step, weight in slices.ends():
            total += (weight * share)[:, None] * flat[(slices.node + step) * (rows * columns) + index]
    return total


@dataclass(frozen=True, eq=False)
class Warp:
    """A stack of bilinear densities with their running integrals; lengths are in node spacings.

    `density` (n, rows, columns) has unit integral per slice; `along_x` (n, rows, columns) is its integral
    along a row from x = 0, `along_y` (n, rows) the integral of whole rows from y = 0.
    """

    density: Array
    along_x: Array
    along_y: Array

    @classmethod
    def of(cls, values: Array) -> "Warp":
        """The warp of non-negative node values (n, rows, columns); every slice needs a positive integral."""
        values = values.astype(np.float64)
        total = _running(_running(values)[..., -1])[..., -1]
        density = values / total[:, None, None]
        along_x = _running(density)
        return cls(density, along_x, _running(along_x[..., -1]))

    def invert(self, slices: Place, x: Array, y: Array) -> tuple[Array, Array]:
        """The uniform samples x and y (m,) that sampling the interpolated density maps to m positions.

        Sampling draws y from the marginal, then x given y. Both integrals of a bilinear density are quadratic
        within a cell, so that the inverse is exact.
        """
        _, rows, columns = self.density.shape
        row, column = between(y, rows), between(x, columns)
        density, along_x, along_y = self.density.ravel(), self.along_x.ravel(), self.along_y.ravel()
        reached, whole, sample_y = np.zeros(len(x)), np.zeros(len(x)), np.zeros(len(x))
        for step, weight in slices.ends():
            line = (slices.node + step) * rows + row.node
            totals = []
            for down, share in row.ends():
                node = (line + down) * columns + column.node
                totals.append(along_x[(line + down + 1) * columns - 1])
                part = along_x[node] + _partial(density[node], density[node + 1], column.fraction)
                reached += weight * share * part
                whole += weight * share * totals[-1]
            sample_y += weight * (along_y[line] + _partial(totals[0], totals[1], row.fraction))
        return reached / np.where(whole > 0, whole, 1.0), sample_y


def _running(values: Array) -> Array:
    """Trapezoid integral from the first node to each node of the last axis."""
    steps = 0.5 * (values[..., 1:] + values[..., :-1])
    return np.concatenate([np.zeros_like(values[..., :1]), np.cumsum(steps, axis=-1)], axis=-1)


def _partial(left: Array, right: Array, fraction: Array) -> Array:
    """Integral of a linear function from its left node to `fraction` of the way to the right one."""
    return fraction * (left + 0.5 * fraction * (right - left))
