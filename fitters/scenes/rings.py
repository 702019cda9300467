"""The light of a map in every ring about the view, in closed form along the rows of the map."""

import numpy as np

from fitters.grid import Array
from fitters.scenes.environment import EnvironmentMap

ROUNDING = 1e-12
"""A ring with less than this share of all light is dark."""
LINES = 16384
"""The least number of lines of constant elevation that are integrated over the whole map."""


def ring_energies(light: EnvironmentMap, count: int, *, degrees: float = 0.0) -> Array:
    """The integral of the radiance over each ring about +z, (count, 3); the rings are equally wide.

    Ring k holds the directions at k / count pi to (k + 1) / count pi from +z. The light is turned about +y by
    `degrees`, as `EnvironmentMap.rotated` does. Texels are constant: along a line of constant elevation the light
    of a ring is exact; over elevations it is a midpoint sum (error 3e-5 of the light table of Grace Cathedral).
    """
    steps = -(-LINES // light.rows)
    edges = np.cos(np.arange(count + 1) / count * np.pi)
    within = np.zeros((count + 1, 3))
    for row in np.flatnonzero(light.radiance.any(axis=(1, 2))):
        limits = (row + np.arange(steps + 1) / steps) / light.rows * np.pi
        bands = -np.diff(np.cos(limits))
        lines = _within(light.radiance[row], (limits[1:] + limits[:-1]) / 2, edges, np.radians(degrees))
        within += np.einsum("n,nmc->mc", bands, lines)
    rings = np.diff(within, axis=0)
    # Differences of equal numbers leave rounding errors, which are not light.
    return np.where(rings > ROUNDING * np.sum(np.abs(rings), axis=0), rings, 0.0)


def _within(radiance: Array, elevations: Array, edges: Array, turn: float) -> Array:
    """The integral (n, m, 3) over azimuth of a row's radiance (columns, 3), as far as z is above an edge (m,), on
    lines at angles (n,) from the zenith.
    """
    columns = len(radiance)
    summed = np.concatenate([np.zeros((1, 3)), np.cumsum(radiance, axis=0)]) * (2 * np.pi / columns)
    # z = -sin(theta) cos(phi) exceeds an edge from some azimuth before pi to the same one after it.
    reach = np.arccos(np.clip(edges / np.sin(elevations)[:, None], -1.0, 1.0))
    # A right-handed turn moves light from azimuth phi + turn to phi.
    return _upto(summed, np.pi + reach + turn) - _upto(summed, np.pi - reach + turn)


def _upto(summed: Array, azimuth: Array) -> Array:
    """The integral of a row from azimuth 0; `summed` (columns + 1, 3) is that up to the edges of its texels."""
    columns = len(summed) - 1
    place = azimuth / (2 * np.pi) * columns
    whole = np.floor(place)
    turns, at = np.divmod(whole.astype(np.int64), columns)
    share = (place - whole)[..., None]
    return turns[..., None] * summed[-1] + summed[at] * (1 - share) + summed[at + 1] * share
