"""The cells that a pixel sees and the light in them: the rows of the image map, one after the other.

The integral over light directions is taken in two ways. Within `NEAR_BINS` bins of theta_half, half vectors are
placed around the normal, as fine as the bins there, so that the sharpest lobe keeps its energy. Elsewhere every
texel of the light gives all its energy to the cell of its centre; texels are as large as the bins allow. So the
smallest window of the light is seen.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fitters import compiled
from fitters.grid import CELLS, SHAPE, Array
from fitters.rendering.shared_exponent import packed_row
from fitters.scenes.cells import cell_index, cell_of, frame_about, texel_of

NEAR_BINS = 12
"""Up to 1.6 degrees from the normal."""
STEPS, AZIMUTHS = 3, 96
"""Half vectors in each of these bins: the number of rings, and the number in a ring."""
SPREAD = 2.0
"""Elsewhere the half vectors of a texel spread over at most this many bins, half as many within `FINE_BINS`."""
FINE_BINS = 30
"""Up to 10 degrees from the normal, where most lobes lie."""
BLOCK = SHAPE[1] * SHAPE[2]
"""Cells of a bin of theta_half."""


@compiled.entry(nogil=True)
def pixel_rows(
    normals: Array,
    views: Array,
    visible: NDArray[np.bool_],
    light_rows: int,
    texels: Array,
    centres: Array,
    rows: NDArray[np.int64],
    starts: NDArray[np.int64],
    steps: int,
    azimuths: int,
    spread: float,
) -> tuple[NDArray[np.int64], NDArray[np.uint16], NDArray[np.uint32], NDArray[np.float32]]:
    """The light that pixels with normals and views (p, 3) see, in the packed form of `fitters.rendering.ImageMap`.

    `visible` (p, texels) says which texels of the light, at `light_rows` rows, each pixel sees; (1, 1) for all.
    `texels`, `centres`, `rows` and `starts` are those of a `Pyramid`.
    """
    count = normals.shape[0]
    pointers = np.zeros(count * SHAPE[0] + 1, np.int64)
    scales = np.zeros(count, np.float32)
    codes, words = np.empty(1 << 16, np.uint16), np.empty(1 << 16, np.uint32)
    sums, touched = np.zeros((CELLS, 3)), np.empty(CELLS, np.int32)
    end = 0
    for p in range(count):
        sees = visible[p % len(visible)]
        cells = _near(normals[p], views[p], sees, light_rows, texels, rows, starts, steps, azimuths, sums, touched)
        cells = _far(
            normals[p], views[p], sees, light_rows, texels, centres, rows, starts, spread, sums, touched, cells
        )
        touched[:cells].sort()
        while end + cells > len(codes):
            codes = np.concatenate((codes, np.empty_like(codes)))
            words = np.concatenate((words, np.empty_like(words)))
        scales[p] = packed_row(sums, touched[:cells], words[end : end + cells])
        for k in range(cells):
            cell = touched[k]
            codes[end + k] = cell % BLOCK
            pointers[p * SHAPE[0] + cell // BLOCK + 1] += 1
            for c in range(3):
                sums[cell, c] = 0.0
        end += cells
    return np.cumsum(pointers), codes[:end].copy(), words[:end].copy(), scales


@njit
def _near(
    normal: Array,
    view: Array,
    sees: NDArray[np.bool_],
    light_rows: int,
    texels: Array,
    rows: NDArray[np.int64],
    starts: NDArray[np.int64],
    steps: int,
    azimuths: int,
    sums: Array,
    touched: NDArray[np.int32],
) -> int:
    """Adds the light whose half vectors lie in the first `NEAR_BINS` bins to `sums` (CELLS, 3), writes the indices
    of the cells to `touched`, and returns their number.
    """
    first, second = frame_about(normal)
    finest = len(rows) - 1
    cells = 0
    for half_bin in range(NEAR_BINS):
        for step in range(steps):
            low, high = _theta_half(half_bin + step / steps), _theta_half(half_bin + (step + 1) / steps)
            cos_half, sin_half = math.cos((low + high) / 2), math.sin((low + high) / 2)
            solid_angle = (math.cos(low) - math.cos(high)) * 2 * math.pi / azimuths
            for k in range(azimuths):
                phi = (k + (step + 0.5) / steps) * 2 * math.pi / azimuths
                half = sin_half * math.cos(phi) * first + sin_half * math.sin(phi) * second + cos_half * normal
                cos_diff = half[0] * view[0] + half[1] * view[1] + half[2] * view[2]
                w_i = 2 * cos_diff * half - view
                cos_i = normal[0] * w_i[0] + normal[1] * w_i[1] + normal[2] * w_i[2]
                if cos_diff <= 0.0 or cos_i <= 0.0 or not (len(sees) == 1 or sees[texel_of(w_i, light_rows)]):
                    continue
                across = (
                    normal[0] * (half[1] * w_i[2] - half[2] * w_i[1])
                    + normal[1] * (half[2] * w_i[0] - half[0] * w_i[2])
                    + normal[2] * (half[0] * w_i[1] - half[1] * w_i[0])
                )
                cell = cell_index(half_bin, cos_diff, math.atan2(across, cos_diff * cos_half - cos_i))
                radiance = texels[starts[finest] + texel_of(w_i, rows[finest])]
                cells = _add(cell, radiance, cos_i * 4 * cos_diff * solid_angle, sums, touched, cells)
    return cells


@njit
def _far(
    normal: Array,
    view: Array,
    sees: NDArray[np.bool_],
    light_rows: int,
    texels: Array,
    centres: Array,
    rows: NDArray[np.int64],
    starts: NDArray[np.int64],
    spread: float,
    sums: Array,
    touched: NDArray[np.int32],
    cells: int,
) -> int:
    """As `_near` for all other light, texel by texel; a texel is divided by four until it is small enough."""
    near, fine, finest = _theta_half(NEAR_BINS), _theta_half(FINE_BINS), len(rows) - 1
    # Texels still to be visited: level, row, column. Dividing one adds four.
    waiting = np.empty((2 * rows[0] ** 2 + 128, 3), np.int64)
    count = 0
    for row in range(rows[0]):
        for column in range(2 * rows[0]):
            waiting[count, 0], waiting[count, 1], waiting[count, 2] = 0, row, column
            count += 1
    w_i = np.empty(3)
    while count > 0:
        count -= 1
        level, row, column = waiting[count]
        stored = min(level, finest)
        beyond = level - stored
        texel = starts[stored] + (row >> beyond) * 2 * rows[stored] + (column >> beyond)
        radiance = texels[texel]
        if radiance[0] == 0.0 and radiance[1] == 0.0 and radiance[2] == 0.0:
            continue
        across = rows[stored] << beyond
        extent = math.pi / across
        upper, lower = math.cos(row * extent), math.cos((row + 1) * extent)
        w_i[1] = (upper + lower) / 2
        level_sine, phi = math.sqrt(1 - w_i[1] ** 2), (column + 0.5) * extent
        w_i[0], w_i[2] = level_sine * math.sin(phi), -level_sine * math.cos(phi)
        cos_i = normal[0] * w_i[0] + normal[1] * w_i[1] + normal[2] * w_i[2]
        # The corners of a texel lie within 0.71 of its extent, those of its half vectors within half of that.
        if cos_i < -0.75 * extent:
            continue
        theta_half = _angle(normal, w_i, view)
        nearest = theta_half - 0.36 * extent
        if theta_half + 0.36 * extent < near:
            continue
        # The bin at theta_half is 2 sqrt(theta_half pi / 2) / 90 wide; where near and far meet, texels are small.
        width = 2 * math.sqrt(max(nearest, near) * (math.pi / 2)) / SHAPE[0]
        bins = spread if nearest >= fine else spread / 2
        largest = bins * width if nearest >= near else width / 4
        if extent / 2 > largest or (len(sees) > 1 and across < light_rows):
            for quarter in range(4):
                waiting[count, 0] = level + 1
                waiting[count, 1], waiting[count, 2] = 2 * row + quarter // 2, 2 * column + quarter % 2
                count += 1
            continue
        if beyond == 0:
            w_i[:] = centres[texel]
            cos_i = normal[0] * w_i[0] + normal[1] * w_i[1] + normal[2] * w_i[2]
            theta_half = _angle(normal, w_i, view)
        if theta_half < near or cos_i <= 0.0 or not (len(sees) == 1 or sees[texel_of(w_i, light_rows)]):
            continue
        weight = cos_i * (upper - lower) * extent
        cells = _add(cell_of(normal, w_i, view, cos_i), radiance, weight, sums, touched, cells)
    return cells


@njit
def _add(cell: int, radiance: Array, weight: float, sums: Array, touched: NDArray[np.int32], cells: int) -> int:
    if sums[cell, 0] == 0.0 and sums[cell, 1] == 0.0 and sums[cell, 2] == 0.0:
        touched[cells] = cell
        cells += 1
    for c in range(3):
        sums[cell, c] += radiance[c] * weight
    return cells


@njit
def _theta_half(bins: float) -> float:
    """theta_half (radians) at a number of bins from 0."""
    return (bins / SHAPE[0]) ** 2 * (math.pi / 2)


@njit
def _angle(normal: Array, w_i: Array, view: Array) -> float:
    """theta_half (radians) of two unit directions about a normal."""
    x, y, z = w_i[0] + view[0], w_i[1] + view[1], w_i[2] + view[2]
    length = max(math.sqrt(x * x + y * y + z * z), 1e-12)
    cosine = (normal[0] * x + normal[1] * y + normal[2] * z) / length
    return math.acos(max(min(cosine, 1.0), -1.0))
