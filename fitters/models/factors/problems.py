"""What a descent solves: the objective of each model over rho_d and the logarithms of its factors."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fitters.grid import SHAPE, Array
from fitters.models.factors import microfacet_equations, naive_equations
from fitters.models.factors.alternation import Mask, filled
from fitters.models.factors.channel import seen
from fitters.models.factors.samples import NODES, Samples
from fitters.models.factors.smith import Smith

LOWEST = np.log(1e-6)
"""The dynamic range of factors (section 4.3)."""

_D, _F, _G = slice(1, 91), slice(91, 181), slice(181, 271)
_H = slice(181, 361)


def _second_differences() -> Array:
    """The matrix (90, 90) of the sum of squared second differences."""
    difference = np.diff(np.eye(NODES), 2, axis=0)
    return difference.T @ difference


_ROUGHNESS = _second_differences()


def in_box(x: Array, scale: slice, *others: slice, powers: tuple[int, ...]) -> Array:
    """x with rho_d >= 0, the `others` in [1e-6, 1], largest component 1, and factor `scale` in its own range.

    What would rise above 1 is cut there: raising the floor of a whole factor for one component would undo what
    all samples say for what few of them do. Where a largest component fell, `scale` takes it up; `powers` says
    how often each of the others appears in the product.
    """
    x = x.copy()
    x[0] = max(x[0], 0.0)
    for factor, power in zip(others, powers, strict=True):
        np.clip(x[factor], LOWEST, 0.0, out=x[factor])
        largest = x[factor].max()
        x[factor] -= largest
        x[scale] += power * largest
    np.maximum(x[scale], x[scale].max() + LOWEST, out=x[scale])
    return x


def _followed(x: Array, d_seen: Mask, f_seen: Mask) -> Array:
    """x with the bins of D and F that no sample sees set from their neighbours, so that none is the largest."""
    x = x.copy()
    x[_D], x[_F] = filled(x[_D], d_seen), filled(x[_F], f_seen)
    return x


def bounds(x: Array, scale: slice) -> tuple[Array, Array]:
    """The box (k,), (k,) around x."""
    low, high = np.full(len(x), LOWEST), np.zeros(len(x))
    low[0], high[0] = 0.0, np.inf
    low[scale], high[scale] = x[scale].max() + LOWEST, np.inf
    return low, high


@dataclass(frozen=True, eq=False)
class IndependentG:
    """Eq. 3 with a free G. Unknowns (271,): rho_d, log rho_s D, log F, log G.

    `smoothing` weighs the squared second differences of log G, against zigzag between neighbouring nodes.
    """

    samples: Samples
    smoothing: float

    def objective(self, x: Array) -> float:
        value = microfacet_equations.objective(*_factors(x), *_arguments(self.samples))
        return value + self.smoothing * float(x[_G] @ _ROUGHNESS @ x[_G])

    def normal_equations(self, x: Array) -> tuple[float, Array, Array]:
        gradient, matrix = np.empty(271), np.empty((271, 271))
        value = microfacet_equations.normal_equations(*_factors(x), *_arguments(self.samples), gradient, matrix)
        bend = _ROUGHNESS @ x[_G]
        gradient[_G] += self.smoothing * bend
        matrix[_G, _G] += self.smoothing * _ROUGHNESS
        return value + self.smoothing * float(x[_G] @ bend), gradient, matrix

    def bounds(self, x: Array) -> tuple[Array, Array]:
        return bounds(x, _D)

    def in_box(self, x: Array) -> Array:
        has = seen(self.samples, by_azimuth=False)
        return in_box(_followed(x, has.d, has.f), _D, _F, _G, powers=(1, 2))


@dataclass(frozen=True, eq=False)
class GFromD:
    """Eq. 3 with Smith's G of D. Unknowns (181,): rho_d, log rho_s D, log F."""

    samples: Samples
    smith: Smith

    def _whole(self, x: Array) -> tuple[Array, Array]:
        """The unknowns (271,) of a free G that stand for x, and how log G changes with log D (90, 90)."""
        g, slope = self.smith.log_derivative(np.exp(x[_D] - x[_D].max()))
        return np.concatenate([x, np.log(g)]), slope

    def objective(self, x: Array) -> float:
        return microfacet_equations.objective(*_factors(self._whole(x)[0]), *_arguments(self.samples))

    def normal_equations(self, x: Array) -> tuple[float, Array, Array]:
        whole, slope = self._whole(x)
        gradient, matrix = np.empty(271), np.empty((271, 271))
        value = microfacet_equations.normal_equations(
            *_factors(whole), *_arguments(self.samples), gradient, matrix
        )
        chain = np.eye(271, 181)
        chain[_G, _D] = slope
        return value, gradient @ chain, chain.T @ matrix @ chain

    def bounds(self, x: Array) -> tuple[Array, Array]:
        return bounds(x, _D)

    def in_box(self, x: Array) -> Array:
        has = seen(self.samples, by_azimuth=False)
        return in_box(_followed(x, has.d, has.f), _D, _F, powers=(1,))


@dataclass(frozen=True, eq=False)
class Naive:
    """Eq. 4. Unknowns (361,): rho_d, log rho_s D, log F, log H."""

    samples: Samples

    def objective(self, x: Array) -> float:
        return naive_equations.objective(x[0], *(np.exp(x[f]) for f in (_D, _F, _H)), *_places(self.samples))

    def normal_equations(self, x: Array) -> tuple[float, Array, Array]:
        gradient, matrix = np.empty(361), np.empty((361, 361))
        value = naive_equations.normal_equations(
            x[0], *(np.exp(x[f]) for f in (_D, _F, _H)), *_places(self.samples), gradient, matrix
        )
        return value, gradient, matrix

    def bounds(self, x: Array) -> tuple[Array, Array]:
        return bounds(x, _D)

    def in_box(self, x: Array) -> Array:
        has = seen(self.samples, by_azimuth=True)
        return in_box(_followed(x, has.d, has.f), _D, _F, _H, powers=(1, 1))


def _factors(x: Array) -> tuple[float, Array, Array, Array]:
    return x[0], np.exp(x[_D]), np.exp(x[_F]), np.exp(x[_G])


def _arguments(samples: Samples) -> tuple[NDArray[Any], ...]:
    at = samples.geometry
    return (
        at.offset, at.node_i, at.node_o, at.part_i, at.part_o, at.cosines, samples.weights, samples.values
    )  # fmt: skip


def _places(samples: Samples) -> tuple[NDArray[Any], ...]:
    at = samples.geometry
    if at.phi.size != SHAPE[2]:
        raise AssertionError("the naive model tells phi_diff from pi - phi_diff: its samples are not folded")
    return at.offset, at.first, samples.weights, samples.values
