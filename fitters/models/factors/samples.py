"""The samples that factors are fitted to: the cells of a material, weighted as eq. 7 of Bagher et al. 2016 asks.

A model of factors is symmetric in the directions, so phi_diff and pi - phi_diff see the same value: two such cells
are one sample with their weights' sum and their weighted mean, and what they differ by is a constant of the
objective. Samples are held by (theta_half, theta_diff), whose azimuths above the horizon are one range.
"""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from fitters import compiled
from fitters.errors import FittersError
from fitters.grid import SHAPE, Array, bin_centres
from fitters.judging.metrics import COMPRESSIVE_POWER
from fitters.materials import Material

LIMIT = np.radians(89.0)
"""Samples with a direction beyond are left out: cosines in the denominator make them unstable (section 4.1)."""

NODES = 90
"""G is linear between its values at 0, 1, .. 89 degrees."""


@dataclass(frozen=True, eq=False)
class SampleGeometry:
    """Where samples lie, the same for every material.

    phi:       (k,) azimuths phi_diff, radians
    first:     (90, 90) azimuth at which the samples of a (theta_half, theta_diff) begin
    offset:    (8101,) sample at which they begin; they are one for each azimuth from `first` on
    node_i, node_o, part_i, part_o: (n,) G(theta) = G[node] + part (G[node + 1] - G[node])
    cosines:   (n,) cos(theta_i) cos(theta_o)
    volume:    (n,) the volume form of eq. 9 times the importance of eq. 10, of one cell
    """

    phi: Array
    first: NDArray[np.int32]
    offset: NDArray[np.int64]
    node_i: NDArray[np.uint8]
    node_o: NDArray[np.uint8]
    part_i: NDArray[np.float32]
    part_o: NDArray[np.float32]
    cosines: NDArray[np.float32]
    volume: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.node_i)

    @cached_property
    def row(self) -> NDArray[np.int32]:
        """(n,) theta_diff + 90 theta_half of each sample's bins."""
        return np.repeat(np.arange(SHAPE[0] * SHAPE[1], dtype=np.int32), np.diff(self.offset))

    @cached_property
    def azimuth(self) -> NDArray[np.int32]:
        """(n,) place of each sample's azimuth among `phi`."""
        begin = (self.offset[:-1] - self.first.ravel()).astype(np.int32)
        return np.arange(len(self), dtype=np.int32) - begin[self.row]


@dataclass(frozen=True, eq=False)
class Samples:
    """What one channel's factors are fitted to: weights and values (n,) float32, and the objective's constant.

    `mostly_zero`: half of the measurement or more is 0, and eq. 11 takes the weighted median of the rest.
    """

    geometry: SampleGeometry
    weights: NDArray[np.float32]
    values: NDArray[np.float32]
    constant: float
    mostly_zero: bool = False

    @cached_property
    def square(self) -> float:
        """The weighted sum of squared values: the objective of a model that is 0 everywhere."""
        return float(np.sum(self.weights * np.square(self.values, dtype=np.float64)))

    def every(self, stride: int) -> "Samples":
        """The samples of every `stride`-th azimuth, the middle one of each group."""
        coarse = geometry(self.geometry.phi.size, stride)
        keep = _kept(self.geometry.phi.size, stride)
        return Samples(coarse, self.weights[keep], self.values[keep], 0.0)


@lru_cache(maxsize=8)
def geometry(azimuths: int, stride: int = 1) -> SampleGeometry:
    """The samples at the first 90 azimuths of the grid (folded) or at all 180, or at every `stride`-th of them."""
    theta_half, theta_diff, phi_diff = bin_centres()
    phi = phi_diff[:azimuths][stride // 2 :: stride]
    th, td, pd = np.meshgrid(theta_half, theta_diff, phi, indexing="ij")
    product, swing = np.cos(th) * np.cos(td), np.sin(th) * np.sin(td) * np.cos(pd)
    cos_i, cos_o = product + swing, product - swing
    inside = (cos_i >= np.cos(LIMIT)) & (cos_o >= np.cos(LIMIT))
    count = inside.sum(axis=2)
    node_i, part_i = _nodes(cos_i[inside])
    node_o, part_o = _nodes(cos_o[inside])
    sin2 = np.sin(td) ** 2
    # d theta_h = 2 theta_h' d theta_h', theta_h' = sqrt(theta_h) evenly sampled
    steps = 2 * np.sqrt(th) * (np.sqrt(np.pi / 2) / SHAPE[0]) * (np.pi / 2 / SHAPE[1]) * (np.pi / SHAPE[2])
    volume = np.sqrt(8 * sin2 * (np.cos(td) ** 2 + sin2 * np.cos(pd) ** 2)) * steps
    cosines = (cos_i * cos_o)[inside]
    return SampleGeometry(
        phi=phi,
        first=np.argmax(inside, axis=2).astype(np.int32),
        offset=np.concatenate([[0], np.cumsum(count.ravel())]),
        node_i=node_i,
        node_o=node_o,
        part_i=part_i,
        part_o=part_o,
        cosines=cosines.astype(np.float32),
        volume=(volume[inside] * cosines).astype(np.float32),
    )


def _nodes(cosine: Array) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    degrees = np.degrees(np.arccos(np.minimum(cosine, 1.0)))
    node = np.minimum(degrees.astype(np.uint8), NODES - 2)
    return node, (degrees - node).astype(np.float32)


@lru_cache(maxsize=8)
def _kept(azimuths: int, stride: int) -> NDArray[np.int64]:
    """Which samples of the full geometry the coarser one has."""
    return np.flatnonzero(geometry(azimuths).azimuth % stride == stride // 2)


def samples(material: Material, *, folded: bool = True) -> list[Samples]:
    """The samples of each channel. Raises `FittersError` where a material has no valid cell up to 89 degrees."""
    places = geometry(SHAPE[2] // 2 if folded else SHAPE[2])
    table = material.table.reshape(3, SHAPE[0] * SHAPE[1], SHAPE[2])
    valid = material.valid.reshape(SHAPE[0] * SHAPE[1], SHAPE[2])
    per_channel = []
    for channel in range(3):
        stored = table[channel].view(np.int32), valid, places.offset, places.first.ravel(), places.volume, folded
        bits = _weighted_median(*stored, 0)
        if bits < 0:
            raise FittersError(
                f"{material.name}: no valid cell has both directions within 89 degrees of the normal; factors "
                "cannot be fitted to it. Check the file."
            )
        mostly_zero = bits == 0
        if mostly_zero:
            # Of 0, eq. 11 would make every weight 0 but those of zeros. A channel of nothing else has any median.
            bits = max(_weighted_median(*stored, 1), 0)
        middle = float(np.int32(bits).view(np.float32)) or 1.0
        weights, values = np.empty(len(places), np.float32), np.empty(len(places), np.float32)
        constant = _weigh(
            table[channel], compressive_weights(table[channel], middle), valid, places.offset,
            places.first.ravel(), places.volume, folded, weights, values,
        )  # fmt: skip
        per_channel.append(Samples(places, weights, values, constant, mostly_zero))
    return per_channel


@compiled.entry(error_model="numpy")
def _weighted_median(values, valid, offset, first, volume, folded, least):
    """The bits (of a float32) of the valid cells' weighted median, given theirs; -1 without a valid cell.

    Cells whose bits are below `least` do not count.

    Exact: the bits of float32 numbers that are not negative are ordered as the numbers are, so that two passes
    of counting, over their upper and lower half, find it.
    """
    bins = np.zeros(65536)
    upper, below = -1, 0.0
    for level in range(2):
        bins[:] = 0.0
        for row in range(len(offset) - 1):
            for j in range(offset[row], offset[row + 1]):
                azimuth = first[row] + j - offset[row]
                for side in range(2 if folded else 1):
                    k = azimuth if side == 0 else valid.shape[1] - 1 - azimuth
                    if not valid[row, k]:
                        continue
                    bits = values[row, k] & 0x7FFFFFFF
                    if bits < least:
                        continue
                    if level == 0:
                        bins[bits >> 16] += volume[j]
                    elif bits >> 16 == upper:
                        bins[bits & 65535] += volume[j]
        if level == 0:
            half = 0.5 * bins.sum()
            if half <= 0.0:
                return -1
        total = below
        for at in range(65536):
            if total + bins[at] >= half and bins[at] > 0.0:
                break
            total += bins[at]
        if level == 0:
            upper, below = at, total
    return (upper << 16) | at


def compressive_weights(values: NDArray[np.float32], middle: float) -> NDArray[np.float32]:
    """w_C of eqs. 11 and 12: 1 at 0, falling as a value rises above the weighted median.

    Evaluated at every number of eight bits and linear between, within 3e-5 of the weight: a tenth of the time.
    """
    bits = np.arange(0, 0x7F80, dtype=np.uint32) << 16
    ratio = np.maximum(bits.view(np.float32).astype(np.float64) * (math.log(2.0) / middle), 1e-30)
    table = ((-np.expm1(-ratio) / ratio) ** COMPRESSIVE_POWER).astype(np.float32)
    weights = np.empty_like(values)
    _look_up(table, values.view(np.int32).ravel(), weights.ravel())
    return weights


@compiled.entry(error_model="numpy")
def _look_up(table, bits, weights):
    """Weights at numbers given by their bits: the mantissa's lower sixteen say how far on to the next entry."""
    for j in range(len(bits)):
        place = (bits[j] >> 16) & 0x7FFF
        share = np.float32(bits[j] & 0xFFFF) / np.float32(65536.0)
        low = table[place]
        weights[j] = low + share * (table[min(place + 1, len(table) - 1)] - low)


@compiled.entry(error_model="numpy")
def _weigh(table, compressed, valid, offset, first, volume, folded, weights, values):
    """Fills weights and values (n,); returns what folding leaves of the objective whatever the model."""
    constant = 0.0
    for row in range(table.shape[0]):
        for j in range(offset[row], offset[row + 1]):
            azimuth = first[row] + j - offset[row]
            w, wz = 0.0, 0.0
            for side in range(2 if folded else 1):
                k = azimuth if side == 0 else table.shape[1] - 1 - azimuth
                if valid[row, k]:
                    own = np.float64(volume[j]) * compressed[row, k]
                    w, wz = w + own, wz + own * table[row, k]
            mean = wz / w if w > 0 else 0.0
            weights[j], values[j] = w, mean
            for side in range(2 if folded else 1):
                k = azimuth if side == 0 else table.shape[1] - 1 - azimuth
                if valid[row, k]:
                    own = np.float64(volume[j]) * compressed[row, k]
                    constant += own * (table[row, k] - mean) ** 2
    return constant
