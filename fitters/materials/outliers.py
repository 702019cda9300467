"""Samples that cannot be meant, found by their neighbours and taken for not measured: spikes and dropouts.

One cell that is a thousand times too bright (dust, a glint) outweighs all others in a sum of squares. A highlight
is no spike, however sharp: it is as wide as the range of phi_diff, and neighbours share it. Zeros between bright
cells are where a device gave nothing; in the compressive weights of Bagher et al. 2016 they would count fully,
and the highlight about them next to nothing.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fitters import compiled
from fitters.grid import Array
from fitters.materials.material import MANY_NEGATIVE, Material

TIMES = 100.0
"""A spike is so many times as bright as the second brightest of its neighbours: the brightest may be one, too.

In the 18 measurements of the RGL database that this project is tried on no cell above the median is."""
NEIGHBOURS = 4
"""So many of the six must hold a positive value: elsewhere nothing is known of what is usual."""


DIM = 0.1
"""Of the median: a zero between cells that are brighter than this is isolated."""
BRIGHT_NEIGHBOURS = 3
"""So many of its six neighbours must be."""
DROPOUTS = 1e-3
"""Where more than this share of a material is isolated zeros, its zeros are not measured. In the RGL
measurements it is 1e-5 at most."""


def without_outliers(material: Material) -> Material:
    """The material with its spikes and dropouts taken for not measured and counted; itself where it has none.

    Where a share of the samples was below zero, what is dark is noise, and neighbours say nothing of each other.
    """
    if max(material.negative) > MANY_NEGATIVE:
        return material
    bright, dark = spikes(material), dropouts(material)
    found = bright | dark
    if not found.any():
        return material
    table, valid = np.where(found, np.float32(0), material.table), material.valid & ~found
    table.flags.writeable = valid.flags.writeable = False
    return replace(
        material,
        table=table,
        valid=valid,
        spikes=int(np.count_nonzero(bright)),
        dropouts=int(np.count_nonzero(dark)),
    )


def dropouts(material: Material) -> NDArray[np.bool_]:
    """(90, 90, 180): valid cells that are zero in all channels, where many such lie between bright ones."""
    zero = material.valid & ~material.table.any(axis=0)
    valid = np.count_nonzero(material.valid)
    if np.count_nonzero(zero) <= DROPOUTS * valid:
        return np.zeros_like(zero)
    total = material.table.sum(axis=0)
    bright = total > DIM * np.median(total[material.valid])
    count = np.zeros(zero.shape, np.int8)
    for axis in range(3):
        for step in (1, -1):
            # Only phi_diff is periodic, but the cells at the other ends are as good as any.
            count += np.roll(bright, step, axis)
    isolated = np.count_nonzero(zero & (count >= BRIGHT_NEIGHBOURS))
    return zero if isolated > DROPOUTS * valid else np.zeros_like(zero)


def spikes(material: Material) -> NDArray[np.bool_]:
    """(90, 90, 180): valid cells that stand out among the six beside them in some channel."""
    found = np.zeros(material.valid.shape, np.bool_)
    for channel in material.table:
        # What is darker than most of the material weighs nothing, and is often noise about 0.
        _find(channel, material.valid, np.float32(TIMES), np.median(channel[material.valid]), found)
    return found


@compiled.entry(error_model="numpy")
def _find(values: Array, valid: NDArray[np.bool_], times: float, least: float, found: NDArray[np.bool_]) -> None:
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
                    found[i, j, k] = True
