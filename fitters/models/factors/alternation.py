"""The linear steps of alternating weighted least squares (section 4.2 of Bagher et al. 2016).

With G (or H) held, a sample's model is rho_d + rho_s D F p, p what G or H make of its place. D, F and the two
coefficients then see the samples through six sums over the azimuths of each (theta_half, theta_diff): one pass
over all samples makes these, and every step after it costs 8,100 cells.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fitters import compiled
from fitters.grid import SHAPE, Array
from fitters.models.factors.samples import Samples

FLOOR = 1e-6
"""No component is less than this share of a factor's largest (dynamic range clamping, section 4.3)."""


Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums (90, 90) over azimuths of w, w p, w p^2, w z, w p z and w z^2."""

    w: Array
    wp: Array
    wpp: Array
    wz: Array
    wpz: Array
    wzz: Array

    def objective(self, rho_d: float, rho_s: float, d: Array, f: Array) -> float:
        """Eq. 7 without the samples' constant."""
        q = rho_s * np.outer(d, f)
        return float(
            np.sum(self.wzz - 2 * rho_d * self.wz + rho_d**2 * self.w)
            + np.sum(q * (q * self.wpp + 2 * (rho_d * self.wp - self.wpz)))
        )

    def coefficients(self, d: Array, f: Array) -> tuple[float, float]:
        """The best rho_d >= 0 and rho_s by eqs. 15 to 18."""
        x = np.outer(d, f)
        w, wx, wxx = self.w.sum(), np.sum(self.wp * x), np.sum(self.wpp * x * x)
        wy, wxy = self.wz.sum(), np.sum(self.wpz * x)
        if wxx <= 0:
            return float(wy / w), 0.0
        determinant = w * wxx - wx * wx
        rho_d = (wy * wxx - wx * wxy) / determinant if determinant > 1e-12 * w * wxx else -1.0
        if rho_d < 0:
            return 0.0, float(wxy / wxx)
        # A share that would be negative is none: then the diffuse part alone is best.
        rho_s = (w * wxy - wx * wy) / determinant
        return (float(rho_d), float(rho_s)) if rho_s > 0 else (float(wy / w), 0.0)

    def best_d(self, rho_d: float, rho_s: float, d: Array, f: Array, floor: float = FLOOR) -> Array:
        """D (90,) by eq. 14 with all else held, clamped; what no sample sees follows its neighbours."""
        top = (self.wpz - rho_d * self.wp) @ f
        return _clamped(top, rho_s * (self.wpp @ (f * f)), d, floor)

    def best_f(self, rho_d: float, rho_s: float, d: Array, f: Array, floor: float = FLOOR) -> Array:
        """F (90,), likewise."""
        top = (self.wpz - rho_d * self.wp).T @ d
        return _clamped(top, rho_s * (self.wpp.T @ (d * d)), f, floor)


def _clamped(top: Array, bottom: Array, old: Array, floor: float) -> Array:
    seen = bottom > 1e-300
    best = filled(top / np.where(seen, bottom, 1.0), seen) if seen.any() else old
    return np.maximum(best, floor * max(float(best.max()), 1e-300))


def shadowed_sums(samples: Samples, g: Array) -> Sums:
    """The sums for p = G_i G_o / (cos theta_i cos theta_o) of the microfacet model, `g` (90,) at the nodes."""
    at, out = samples.geometry, np.empty((6, SHAPE[0] * SHAPE[1]))
    _sum_shadowed(
        g, at.offset, at.node_i, at.node_o, at.part_i, at.part_o, at.cosines, samples.weights, samples.values, out
    )
    return Sums(*out.reshape(6, SHAPE[0], SHAPE[1]))


def azimuthal_sums(samples: Samples, h: Array) -> Sums:
    """The sums for p = H(phi_diff) of the naive model, `h` (k,) at the samples' azimuths."""
    out = np.empty((6, SHAPE[0] * SHAPE[1]))
    _sum_azimuths(h, samples.geometry.offset, samples.geometry.first, samples.weights, samples.values, out)
    return Sums(*out.reshape(6, SHAPE[0], SHAPE[1]))


_NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@njit(fastmath={"contract", "reassoc", "nsz"})
def _added(total, w, p, z):
    """The six sums with one more sample."""
    wp = w * p
    s0, s1, s2, s3, s4, s5 = total
    return s0 + w, s1 + wp, s2 + wp * p, s3 + w * z, s4 + wp * z, s5 + w * z * z


@compiled.entry(fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")
def _sum_shadowed(g, offset, node_i, node_o, part_i, part_o, cosines, weights, values, out):
    for row in range(len(offset) - 1):
        total = _NOTHING
        for j in range(offset[row], offset[row + 1]):
            a, b = node_i[j], node_o[j]
            g_i = g[a] + part_i[j] * (g[a + 1] - g[a])
            g_o = g[b] + part_o[j] * (g[b + 1] - g[b])
            p = g_i * g_o / cosines[j]
            total = _added(total, weights[j], p, values[j])
        out[0, row], out[1, row], out[2, row], out[3, row], out[4, row], out[5, row] = total


@compiled.entry(fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")
def _sum_azimuths(h, offset, first, weights, values, out):
    for row in range(len(offset) - 1):
        total = _NOTHING
        shift = first[row // 90, row % 90] - offset[row]
        for j in range(offset[row], offset[row + 1]):
            total = _added(total, weights[j], h[j + shift], values[j])
        out[0, row], out[1, row], out[2, row], out[3, row], out[4, row], out[5, row] = total


def alternate(known: Sums, d: Array, f: Array, sweeps: int) -> tuple[float, float, Array, Array]:
    """rho_d, rho_s, D and F after rounds of eqs. 14 to 18 from `d` and `f` (90,), largest components 1."""
    rho_d, rho_s = known.coefficients(d, f)
    for _ in range(sweeps):
        d = known.best_d(rho_d, rho_s or 1.0, d, f)
        d = d / d.max()
        rho_d, rho_s = known.coefficients(d, f)
        f = known.best_f(rho_d, rho_s or 1.0, d, f)
        f = f / f.max()
        rho_d, rho_s = known.coefficients(d, f)
    return rho_d, rho_s, d, f


def filled(values: Array, mask: Mask) -> Array:
    """Values (k,) with those outside the mask interpolated from the others, beyond the outermost held."""
    if mask.all() or not mask.any():
        return values
    places = np.arange(len(values))
    return np.interp(places, places[mask], values[mask])
