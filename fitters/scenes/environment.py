"""Latitude-longitude environment maps: directions and solid angles of texels, and exact resampling."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from fitters.errors import FittersError
from fitters.grid import Array


@dataclass(frozen=True, eq=False)
class EnvironmentMap:
    """Distant light, constant within each texel: `radiance` (rows, 2 rows, 3), float64, linear RGB.

    Row 0 is the zenith (+y). Raises `FittersError` unless the radiance is finite, nowhere negative and
    somewhere positive.
    """

    radiance: Array

    def __post_init__(self) -> None:
        shape = self.radiance.shape
        if len(shape) != 3 or shape[0] < 1 or shape[1] != 2 * shape[0] or shape[2] != 3:
            raise FittersError(f"environment map: shape {shape} is not (rows, 2 rows, 3)")
        if self.radiance.dtype != np.float64:
            raise FittersError(f"environment map: radiance is {self.radiance.dtype}, not float64")
        wrong = int(np.count_nonzero(~(np.isfinite(self.radiance) & (self.radiance >= 0))))
        if wrong:
            raise FittersError(f"environment map: {wrong} values are negative or not finite")
        if not self.radiance.any():
            raise FittersError("environment map: every texel is black; give a map with light in it")

    @property
    def rows(self) -> int:
        """Number of rows, half the number of columns."""
        return self.radiance.shape[0]

    def directions(self) -> Array:
        """Unit directions (rows, 2 rows, 3) towards the texel centres, in world space."""
        return texel_directions(self.rows)

    def solid_angles(self) -> Array:
        """Exact solid angle (rows, 1) of a texel of each row, steradians; all texels add up to 4 pi."""
        bands = -np.diff(np.cos(np.arange(self.rows + 1) / self.rows * np.pi))
        return (bands * np.pi / self.rows)[:, None]

    def power(self) -> Array:
        """Integral of the radiance over the sphere of directions, (3,)."""
        return np.sum(self.radiance * self.solid_angles()[..., None], axis=(0, 1))

    def reduced(self, rows: int) -> "EnvironmentMap":
        """The map with `rows` rows: solid-angle-weighted averages over exact texel overlaps."""
        return self.resampled(rows, 0.0)

    def rotated(self, degrees: float) -> "EnvironmentMap":
        """The map turned about +y by `degrees`, right-handed: +z goes to +x, texels to lower columns."""
        return self.resampled(self.rows, degrees)

    def resampled(self, rows: int, degrees: float) -> "EnvironmentMap":
        """`rotated(degrees).reduced(rows)` in one step; `power` and a constant map stay as they are."""
        if rows == self.rows and degrees % 360 == 0:
            return self
        across = _column_weights(2 * self.rows, 2 * rows, degrees % 360 / 360)
        down = _row_weights(self.rows, rows)
        narrow = np.stack([self.radiance[..., c] @ across.T for c in range(3)], axis=-1)
        return EnvironmentMap((down @ narrow.reshape(self.rows, -1)).reshape(rows, 2 * rows, 3))


def texel_angles(rows: int) -> tuple[Array, Array]:
    """theta (rows,) from +y and phi (2 rows,) of texel centres; phi = 0 is -z, phi = pi/2 is +x."""
    theta = (np.arange(rows) + 0.5) / rows * np.pi
    phi = (np.arange(2 * rows) + 0.5) / rows * np.pi
    return theta, phi


def texel_directions(rows: int) -> Array:
    """Unit directions (rows, 2 rows, 3) towards the texel centres of a map of `rows` rows, in world space."""
    theta, phi = texel_angles(rows)
    sin_theta, cos_theta = np.sin(theta)[:, None], np.cos(theta)[:, None]
    x, y, z = sin_theta * np.sin(phi), cos_theta, -sin_theta * np.cos(phi)
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)


def _edges(source: int, target: int) -> Array:
    # In units of source texels, and rounded, so that edges which coincide are equal: otherwise rounding errors
    # would bring light into a texel that has none.
    return np.round(np.arange(target + 1) * (source / target), 9)


def _row_weights(source: int, target: int) -> csr_array:
    edges = np.union1d(np.arange(source + 1), _edges(source, target))
    sizes = -np.diff(np.cos(edges / source * np.pi))
    return _averages(edges, sizes, source, target, _edges(source, target))


def _column_weights(source: int, target: int, turn: float) -> csr_array:
    # A right-handed turn by an angle a moves light from azimuth phi + a to phi; source columns are periodic.
    targets = np.round(_edges(source, target) + turn * source, 9)
    edges = np.union1d(np.arange(np.ceil(targets[0]), np.floor(targets[-1]) + 1), targets)
    return _averages(edges, np.diff(edges), source, target, targets)


def _averages(edges: Array, sizes: Array, source: int, target: int, targets: Array) -> csr_array:
    """Weights (target, source), rows summing to 1, from pieces between `edges` that each lie in one texel."""
    middles = (edges[1:] + edges[:-1]) / 2
    into = np.searchsorted(targets, middles) - 1
    out_of = middles.astype(np.int64) % source
    totals = np.bincount(into, weights=sizes, minlength=target)
    return csr_array((sizes / totals[into], (into, out_of)), shape=(target, source))
