"""Samples that contradict their neighbours, spikes and dropouts, are taken for not measured.

One cell that is a thousand times too bright (dust, a glint) outweighs all others in a sum of squares. A highlight
is not a spike, however sharp: it is as wide as the range of phi_diff, and its neighbours are bright, too. Zeros
between bright cells are failures of the device; the compressive weights of Bagher et al. 2016 would give them full
weight, and almost none to the highlight around them.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fitters import compiled
from fitters.grid import Array
from fitters.materials.material import MANY_NEGATIVE, Material

TIMES = 100.0
"""A spike is this many times as bright as the second brightest of its neighbours: the brightest may be one, too.

No cell above the median is a spike in the 18 measurements of the RGL database that this project is tested with."""
NEIGHBOURS = 4
"""At least this many of the six neighbours must be positive, so that it is known how bright a cell should be."""

DIM = 0.1
"""A zero between cells that are brighter than this share of the median is isolated."""
BRIGHT_NEIGHBOURS = 3
"""At least this many of its six neighbours must be brighter."""
DROPOUTS = 1e-3
"""Where more than this share of a material's cells are isolated zeros, its zeros are not measured. In the RGL
measurements the share is at most 1e-5."""


def without_outliers(material: Material) -> Material:
    """The material with its spikes and dropouts taken for not measured and counted; the same where it has none.

    Where many samples were below zero, dark values are noise, so that neighbours do not predict each other.
    """
    if max(material.negative) > MANY_NEGATIVE:
        return material
    bright, dark = spikes(material), dropouts(material)
    outliers = bright | dark
    if not outliers.any():
        return material
    table, valid = np.where(outliers, np.float32(0), material.table), material.valid & ~outliers
    table.flags.writeable = valid.flags.writeable = False
    return replace(
        material,
        table=table,
        valid=valid,
        spikes=int(np.count_nonzero(bright)),
        dropouts=int(np.count_nonzero(dark)),
    )


def dropouts(material: Material) -> NDArray[np.bool_]:
    """(90, 90, 180): valid cells that are zero in all channels, if many of them lie between bright cells."""
    zero = material.valid & ~material.table.any(axis=0)
    valid = np.count_nonzero(material.valid)
    if np.count_nonzero(zero) <= DROPOUTS * valid:
        return np.zeros_like(zero)
    total = material.table.sum(axis=0)
    bright = total > DIM * np.median(total[material.valid])
    count = np.zeros(zero.shape, np.int8)
    for axis in range(3):
        for step in (1, -1):
            # Only phi_diff is periodic; on the other axes a cell of the opposite end is as good as a neighbour.
            count += np.roll(bright, step, axis)
    isolated = np.count_nonzero(zero & (count >= BRIGHT_NEIGHBOURS))
    return zero if isolated > DROPOUTS * valid else np.zeros_like(zero)


def spikes(material: Material) -> NDArray[np.bool_]:
    """(90, 90, 180): valid cells that are far brighter than their six neighbours in some channel."""
    outliers = np.zeros(material.valid.shape, np.bool_)
    for channel in material.table:
        # Cells darker than the median have no weight in a fit, and are often noise about 0.
        _find(channel, material.valid, np.float32(TIMES), np.median(channel[material.valid]), outliers)
    return outliers


@compiled.entry(error_model="numpy")
def _find(
    values: Array, valid: NDArray[np.bool_], times: float, least: float, outliers: NDArray[np.bool_]
) -> None:
    halves, diffs, azimuths = values.shape
    for i in range(halves):
        for j in range(diffs):
            for k in range(azimuths):
                value = values[i, j, k]
                if not valid[i, j, k] or value <= least:
                    continue
                first, second, count = np.float32(0.0), np.float32(0.0), 0
                for side in range(6):
                    a = i + (side == 0) - (side == 1)
                    b = j + (side == 2) - (side == 3)
                    # phi_diff is periodic: pi is 0.
                    c = (k + (side == 4) - (side == 5)) % azimuths
                    if a < 0 or b < 0 or a >= halves or b >= diffs or not valid[a, b, c]:
                        continue
                    beside = values[a, b, c]
                    count += beside > 0.0
                    if beside > first:
                        first, second = beside, first
                    elif beside > second:
                        second = beside
                if count >= NEIGHBOURS and value > times * second:
                    outliers[i, j, k] = True
