"""The light of no scene in particular: the same from everywhere, in closed form."""

from functools import cache

import numpy as np

from fitters import cache as disk
from fitters.grid import SHAPE, above_horizon, cell_directions
from fitters.scenes.table import LightTable


@cache
def uniform_light() -> LightTable:
    """The light table of radiance 1 from every direction, over all cells above the horizon.

    Over the image of a sphere cos(theta_o) d omega_o / pi is the share of pixels with that normal, so that a cell
    carries the integral of cos(theta_i) cos(theta_o) d omega_i d omega_o / pi, where d omega_i d omega_o =
    4 cos(theta_diff) d omega_half d omega_diff (Rusinkiewicz 1998; Walter et al. 2007, eq. 14). All cells
    together carry pi.
    """
    w_i, w_o = cell_directions()
    cosines = np.where(above_horizon().ravel(), w_i[:, 2] * w_o[:, 2], 0.0).reshape(SHAPE)
    halves, diffs, azimuths = SHAPE
    # theta_half = (i / 90)^2 pi / 2: bins as their edges have them, exactly.
    half = -np.diff(np.cos((np.arange(halves + 1) / halves) ** 2 * (np.pi / 2)))
    # The integral of 4 cos(theta_diff) sin(theta_diff) over bins of a degree.
    diff = np.diff(2.0 * np.sin(np.arange(diffs + 1) / diffs * (np.pi / 2)) ** 2)
    # phi_diff counts modulo pi, and phi_half runs all the way round.
    round_about = 2.0 * np.pi / azimuths * 2.0 * np.pi
    carried = cosines * half[:, None, None] * diff[None, :, None] * (round_about / np.pi)
    table = np.broadcast_to(carried, (3, *SHAPE)).astype(np.float32)
    return LightTable(table, table[0] > 0, disk.digest("uniform light"))
