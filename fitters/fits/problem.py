"""A fit problem: materials under a light, as arrays over cells, whole and as a small weighted sample.

Cells that the scene does not light, or where no material is valid, are left out from the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters import cache
from fitters.errors import FittersError
from fitters.expressions.evaluation import features
from fitters.fits.metrics import METRICS, Metric
from fitters.grid import Array, cell_directions
from fitters.materials import Material
from fitters.scenes import LightTable

UNIFORM_SHARE = 0.3
"""Of the sampled cells, so many are drawn uniformly, the rest by the energy they carry."""

CHANNELS = ("red", "green", "blue")


@dataclass(frozen=True, eq=False)
class Cells:
    """Some lit cells and what a fit needs of them.

    index:    (n,) flat indices on the grid
    features: each (n,) float64, see `fitters.expressions.evaluation.FEATURES`
    weights:  (targets, n) float32, w / s of the metric times the square root of the sampling weight; 0 where
              the target is not valid
    targets:  (targets, n) float32, weights times measured value

    so that a target's error is || weights f - targets ||.
    """

    index: NDArray[np.int64]
    features: dict[str, Array]
    weights: NDArray[np.float32]
    targets: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.index)

    def take(self, chosen: NDArray[np.int64], sampling_weights: Array) -> "Cells":
        """The chosen cells (k,), each standing for `sampling_weights` (k,) of them."""
        root = np.sqrt(sampling_weights).astype(np.float32)
        return Cells(
            index=self.index[chosen],
            features={name: np.ascontiguousarray(values[chosen]) for name, values in self.features.items()},
            weights=np.ascontiguousarray(self.weights[:, chosen] * root),
            targets=np.ascontiguousarray(self.targets[:, chosen] * root),
        )


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Targets to explain: one per material and colour channel, material by material.

    `sha256` identifies the whole problem: equal problems have equal fits.
    """

    materials: tuple[str, ...]
    metric: Metric
    full: Cells
    sample: Cells
    sha256: str

    @property
    def targets(self) -> tuple[tuple[str, str], ...]:
        """(material, channel) of every target."""
        return tuple((material, channel) for material in self.materials for channel in CHANNELS)


def fit_problem(
    materials: Sequence[Material], light: LightTable, *, metric: str, sample_cells: int, seed: int
) -> FitProblem:
    """The problem of fitting the materials (not empty, names distinct) under a light by a metric's name.

    `sample_cells` cells are drawn with `seed`; where there are fewer, the sample is all of them.
    """
    names = tuple(material.name for material in materials)
    if not names or len(set(names)) < len(names):
        raise FittersError(
            f"materials: {len(names)} given, {len(set(names))} different names; name each once"
        )
    valid = np.any([material.valid for material in materials], axis=0)
    index = np.flatnonzero((light.lit & valid).ravel())
    if not len(index):
        raise FittersError("the scene lights no cell in which a material was measured: choose another light")
    full = _full_cells(materials, light, METRICS[metric], index)
    key = cache.digest(metric, sample_cells, seed, light.sha256, *(m.sha256 for m in materials))
    return FitProblem(names, METRICS[metric], full, sample(full, sample_cells, seed), key)


def _full_cells(
    materials: Sequence[Material], light: LightTable, metric: Metric, index: NDArray[np.int64]
) -> Cells:
    w_i, w_o = cell_directions()
    carried = light.table.reshape(3, -1)[:, index].astype(np.float64)
    weights = np.zeros((3 * len(materials), len(index)), np.float32)
    targets = np.zeros_like(weights)
    for number, material in enumerate(materials):
        valid = material.valid.ravel()[index]
        measured = material.table.reshape(3, -1)[:, index].astype(np.float64)
        for channel in range(3):
            w, m = metric.weights(carried[channel][valid], measured[channel][valid]), measured[channel][valid]
            w = w / metric.scale(w, m)
            weights[3 * number + channel, valid] = w
            targets[3 * number + channel, valid] = w * m
    return Cells(index, features(w_i[index], w_o[index]), weights, targets)


def sample(cells: Cells, count: int, seed: int) -> Cells:
    """About `count` cells: a uniform share, the rest drawn by their energy, mean over targets; systematic, seeded.

    Each stands for 1 / (its expected number of draws) cells, which keeps sums over cells unbiased.
    """
    n = len(cells)
    if count >= n:
        return cells
    energy = np.square(cells.targets, dtype=np.float64)
    totals = energy.sum(axis=1, keepdims=True)
    energy = np.mean(np.divide(energy, totals, out=np.zeros_like(energy), where=totals > 0), axis=0)
    energy = energy / energy.sum() if energy.sum() > 0 else np.full(n, 1.0 / n)
    probability = UNIFORM_SHARE / n + (1.0 - UNIFORM_SHARE) * energy
    cumulative = np.cumsum(probability)
    offset = np.random.default_rng(seed).random()
    points = (np.arange(count) + offset) / count * cumulative[-1]
    drawn, times = np.unique(np.minimum(np.searchsorted(cumulative, points), n - 1), return_counts=True)
    return cells.take(drawn, times / (count * probability[drawn]))
