"""Slope densities P over the elevation theta: a power of cos(theta) between nodes, integrated in closed form.

With t = log(1 + tan^2 theta) = -2 log cos(theta), log P is linear in t. A narrow Beckmann lobe,
exp(-tan^2 / alpha^2), and the grazing end of any lobe, cos^n, are straight lines in it. So is the logarithm of the
measure of a ring of slopes, pi P e^t dt. Below the first node P is constant, beyond the last it falls as cos^5:
constant backscattering.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from fitters.errors import FittersError
from fitters.grid import Array

TAIL = -2.5
"""The slope of log P in t beyond the last node."""
LEAST = 1e-290
"""P is at least this share of its largest value, so that it has a logarithm."""

_LEGENDRE = np.polynomial.legendre.leggauss(4)
_LAGUERRE = np.polynomial.laguerre.laggauss(8)


class Quadrature(NamedTuple):
    """`tan_theta` (q,) and weights (..., q): a mean over the slopes of each density."""

    tan_theta: Array
    weight: Array


@dataclass(frozen=True, eq=False)
class Slopes:
    """One or more (...) densities over segments of `t` (n + 1,): `log_p`, `rate` and `level` are (..., n + 1).

    `rate` is d log P / dt from a node on, `level` the integral of 2 pi P tan(theta) up to a node, as if P did not
    depend on the azimuth. The first node is theta = 0.
    """

    t: Array
    log_p: Array
    rate: Array
    level: Array

    @property
    def total(self) -> Array:
        """The integral (...) of each density over all slopes."""
        start, growth = self.start[..., -1], self.rate[..., -1] + 1
        return self.level[..., -1] - start / growth

    @property
    def start(self) -> Array:
        """pi P e^t (..., n + 1): what a segment's measure starts from."""
        return np.pi * np.exp(self.log_p + self.t)


def slopes(theta: Array, p: Array) -> Slopes:
    """The densities with values `p` (..., n) at increasing elevations `theta` (n,) below pi / 2, as they are."""
    largest = p.max()
    if not (np.isfinite(largest) and largest > 0 and p.min() >= 0):
        raise FittersError("a slope density needs finite values of at least 0, some of them positive")
    t = np.concatenate([[0.0], np.log1p(np.tan(theta) ** 2)])
    log_p = np.log(np.maximum(p, LEAST * largest))
    log_p = np.concatenate([log_p[..., :1], log_p], axis=-1)
    step = np.diff(t)
    # Where the first node is theta = 0 itself, the segment below it is empty.
    rate = np.diff(log_p, axis=-1) / np.where(step > 0, step, 1.0)
    rate = np.concatenate([rate, np.full_like(log_p[..., :1], TAIL)], axis=-1)
    mass = np.pi * np.exp((log_p + t)[..., :-1]) * step * _mean_growth((rate[..., :-1] + 1) * step)
    level = np.concatenate([np.zeros_like(log_p[..., :1]), np.cumsum(mass, axis=-1)], axis=-1)
    return Slopes(t, log_p, rate, level)


def quadrature(density: Slopes) -> Quadrature:
    """Nodes and weights for the mean of a function of the slope; functions may grow as the slope itself."""
    x, w = _LEGENDRE
    step = np.diff(density.t)
    share = (x + 1) / 2
    inner = density.t[:-1, None] + step[:, None] * share
    growth = (density.rate[..., :-1] + 1)[..., None]
    weight = density.start[..., :-1, None] * np.exp(growth * (step[:, None] * share)) * step[:, None] * w / 2
    flat = weight.reshape(*weight.shape[:-2], -1)
    # A segment that spans orders of magnitude is not resolved by 4 points: its points share what it holds.
    held = np.diff(density.level, axis=-1)
    flat = flat * np.repeat(held / np.maximum(weight.sum(axis=-1), 1e-300), len(x), axis=-1)
    y, v = _LAGUERRE
    outer = density.start[..., -1:] * np.exp((density.rate[..., -1:] + 1) * y + y) * v
    outer *= (-density.start[..., -1] / (density.rate[..., -1] + 1) / outer.sum(axis=-1))[..., None]
    t = np.concatenate([inner.ravel(), density.t[-1] + y])
    return Quadrature(np.sqrt(np.expm1(t)), np.concatenate([flat, outer], axis=-1))


def mean_square(density: Slopes) -> Array:
    """The integral (...) of tan^2(theta) P over the slopes, as if P did not depend on the azimuth."""
    step = np.diff(density.t)
    grown = density.start * np.exp(density.t)
    inner = grown[..., :-1] * step * _mean_growth((density.rate[..., :-1] + 2) * step)
    return inner.sum(axis=-1) - grown[..., -1] / (density.rate[..., -1] + 2) - density.total


def clamped_mean(product: Array) -> Array:
    """The mean of max(0, 1 + x cos(phi)) over phi (...) for x >= 0: o.h / (cos cos) with x = tan tan, eq. 23."""
    beyond = np.maximum(product, 1.0)
    return np.where(product > 1, (np.arccos(-1 / beyond) + np.sqrt(beyond**2 - 1)) / np.pi, 1.0)


def _mean_growth(x: Array) -> Array:
    """expm1(x) / x (...), 1 at 0."""
    safe = np.where(np.abs(x) > 1e-12, x, 1.0)
    return np.where(np.abs(x) > 1e-12, np.expm1(np.minimum(safe, 700.0)) / safe, 1.0)


@njit(error_model="numpy")
def travelled(mass: float, start: float, growth: float) -> float:
    """The step in t after which a segment that starts from pi P e^t = `start` has held `mass`."""
    if start <= 0.0:
        return 0.0
    held = growth * mass / start
    if abs(held) < 1e-12:
        return mass / start
    return np.log1p(max(held, -1.0 + 1e-15)) / growth
