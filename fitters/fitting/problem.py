"""A fit problem: materials under a light, as arrays over cells, whole and as a small weighted sample.

Cells that the scene does not light, or where no material is valid, are left out from the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fitters import cache
from fitters.errors import FittersError
from fitters.expressions.evaluation import features
from fitters.grid import Array, cell_directions
from fitters.judging.metrics import RESIDUALS, Residual
from fitters.materials import Material
from fitters.scenes import LightTable

SHARES = {"uniform": 0.2, "light": 0.3, "energy": 0.5}
"""How sampled cells are drawn: uniformly, by their light alone, by the reflected energy they carry.

Energy is where a good formula is judged, light where a bad one may go wrong unseen.
"""

COARSE = 4
"""Of so many draws of a sample one belongs to its coarse part."""

CHANNELS = ("red", "green", "blue")

ORDINARY = (1e-4, 1e4)
"""Levels of a measurement, sr^-1, for which bounds of parameters are meant. Others are in other units: there the
bounds of what a formula is linear in count in these, so that its fit does not depend on the units."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """A smaller sample, which a larger one begins with: weights and targets (targets, m) for its first m cells."""

    weights: NDArray[np.float32]
    targets: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Cells:
    """Some lit cells and what a fit needs of them.

    index:    (n,) flat indices on the grid
    features: each (n,) float64, see `fitters.expressions.evaluation.FEATURES`
    weights:  (targets, n) float32, w / s of the metric times the square root of the sampling weight; 0 where
              the target is not valid
    targets:  (targets, n) float32, weights times measured value
    draws:    (n,) how often each was drawn; None where these are all cells
    coarse:   where the search for the right valley may begin; None where it must use all
    units:    (targets,) sr^-1 in which the bounds of linear parameters count; None for 1

    so that a target's error is || weights f - targets ||.
    """

    index: NDArray[np.int64]
    features: dict[str, Array]
    weights: NDArray[np.float32]
    targets: NDArray[np.float32]
    draws: NDArray[np.int64] | None = None
    coarse: Coarse | None = None
    units: Array | None = None

    def __len__(self) -> int:
        return len(self.index)

    def only(self, chosen: NDArray[np.int64]) -> "Cells":
        """The chosen cells (k,) as they are, without those that a sample would make them stand for."""
        return Cells(
            index=self.index[chosen],
            features={name: np.ascontiguousarray(values[chosen]) for name, values in self.features.items()},
            weights=np.ascontiguousarray(self.weights[:, chosen]),
            targets=np.ascontiguousarray(self.targets[:, chosen]),
            units=self.units,
        )

    def targets_only(self, rows: slice) -> "Cells":
        """The same cells with some of the targets."""
        coarse = self.coarse and Coarse(self.coarse.weights[rows], self.coarse.targets[rows])
        units = None if self.units is None else self.units[rows]
        return replace(self, weights=self.weights[rows], targets=self.targets[rows], coarse=coarse, units=units)

    def take(
        self, chosen: NDArray[np.int64], draws: NDArray[np.int64], sampling_weights: Array, coarse_weights: Array
    ) -> "Cells":
        """The chosen cells (k,), drawn so often, each standing for `sampling_weights` (k,) of them.

        The first of them are a smaller sample too, in which each stands for `coarse_weights` (m,) cells.
        """
        weights, targets = self.weights[:, chosen], self.targets[:, chosen]
        root, coarse_root = (np.sqrt(w).astype(np.float32) for w in (sampling_weights, coarse_weights))
        m = len(coarse_root)
        return Cells(
            index=self.index[chosen],
            features={name: np.ascontiguousarray(values[chosen]) for name, values in self.features.items()},
            weights=np.ascontiguousarray(weights * root),
            targets=np.ascontiguousarray(targets * root),
            draws=draws,
            coarse=Coarse(
                np.ascontiguousarray(weights[:, :m] * coarse_root),
                np.ascontiguousarray(targets[:, :m] * coarse_root),
            ),
            units=self.units,
        )


@dataclass(frozen=True, eq=False)
class Source:
    """What cells are made of: the materials, the light, and the flat indices of the cells that both cover."""

    materials: tuple[Material, ...]
    light: LightTable
    index: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Targets to explain: one per material and colour channel, material by material.

    `full` holds all cells that matter, `fine` and `sample` are weighted samples of them, large and small.
    `sha256` identifies the whole problem: equal problems have equal fits.
    """

    source: "Source"
    metric: Residual
    full: Cells
    fine: Cells
    sample: Cells
    sha256: str

    @property
    def materials(self) -> tuple[str, ...]:
        return tuple(material.name for material in self.source.materials)

    @property
    def targets(self) -> tuple[tuple[str, str], ...]:
        """(material, channel) of every target."""
        return tuple((material, channel) for material in self.materials for channel in CHANNELS)


def fit_problem(
    materials: Sequence[Material],
    light: LightTable,
    *,
    metric: str,
    sample_cells: int,
    fine_cells: int = 16384,
    seed: int,
) -> FitProblem:
    """The problem of fitting the materials (not empty, names distinct) under a light by a metric's name.

    `sample_cells` and `fine_cells` cells are drawn with `seed`; where there are fewer, a sample is all.
    """
    source = lit_source(materials, light)
    full = full_cells(source, RESIDUALS[metric])
    key = cache.digest(metric, sample_cells, fine_cells, seed, light.sha256, *(m.sha256 for m in materials))
    fine, coarse = sample(full, fine_cells, seed), sample(full, sample_cells, seed)
    return FitProblem(source, RESIDUALS[metric], full, fine, coarse, key)


def of_material(problem: FitProblem, material: int) -> FitProblem:
    """The same problem for one of its materials alone, on the same cells."""
    rows = slice(len(CHANNELS) * material, len(CHANNELS) * (material + 1))
    source = replace(problem.source, materials=(problem.source.materials[material],))
    full, fine, coarse = (cells.targets_only(rows) for cells in (problem.full, problem.fine, problem.sample))
    key = cache.digest("of material", problem.sha256, material)
    return FitProblem(source, problem.metric, full, fine, coarse, key)


def lit_source(materials: Sequence[Material], light: LightTable) -> Source:
    """The cells that materials (not empty, names distinct) and a light cover. Raises `FittersError`."""
    names = tuple(material.name for material in materials)
    if not names or len(set(names)) < len(names):
        raise FittersError(f"materials: {len(names)} given, {len(set(names))} different names; name each once")
    valid = np.any([material.valid for material in materials], axis=0)
    index = np.flatnonzero((light.lit & valid).ravel())
    if not len(index):
        raise FittersError("the scene lights no cell in which a material was measured: choose another light")
    for material in materials:
        if not np.any(material.valid.ravel()[index]):
            raise FittersError(f"{material.name}: the scene lights none of its cells; choose another light")
    return Source(tuple(materials), light, index)


def full_cells(source: Source, metric: Residual) -> Cells:
    """All cells of a source, weighted for a metric."""
    count = len(CHANNELS) * len(source.materials)
    weights = np.empty((count, len(source.index)), np.float32)
    targets = np.empty_like(weights)
    for target in range(count):
        weights[target], targets[target] = weighted_target(source, metric, target)
    w_i, w_o = cell_directions()
    seen = features(w_i[source.index], w_o[source.index])
    return Cells(source.index, seen, weights, targets, units=_units(source))


def _units(source: Source) -> Array | None:
    """Per target a power of ten near its level, the mean of m under T, where that is no reflectance in sr^-1."""
    levels = np.ones(len(CHANNELS) * len(source.materials))
    for target in range(len(levels)):
        material, channel = source.materials[target // len(CHANNELS)], target % len(CHANNELS)
        light = source.light.table[channel].ravel()[source.index].astype(np.float64)
        measured = light * material.table[channel].ravel()[source.index]
        if light.any() and measured.any():
            levels[target] = np.sum(measured) / np.sum(light)
    units = np.where((levels >= ORDINARY[0]) & (levels <= ORDINARY[1]), 1.0, 10.0 ** np.round(np.log10(levels)))
    return None if np.all(units == 1.0) else units


def weighted_target(source: Source, metric: Residual, target: int) -> tuple[Array, Array]:
    """Weights (n,) of one target over all cells, 0 where it is not valid, and weights times measured values."""
    material, channel = source.materials[target // len(CHANNELS)], target % len(CHANNELS)
    valid = material.valid.ravel()[source.index]
    at = source.index[valid]
    light = source.light.table[channel].ravel()[at].astype(np.float64)
    measured = material.table[channel].ravel()[at].astype(np.float64)
    weights, targets = np.zeros(len(source.index)), np.zeros(len(source.index))
    weights[valid], targets[valid] = metric.weighted(light, measured)
    return weights, targets


def sample(cells: Cells, count: int, seed: int) -> Cells:
    """About `count` cells, drawn in the `SHARES` above (means over targets); systematic, seeded.

    Each stands for 1 / (its expected number of draws) cells, which keeps sums over cells unbiased.
    """
    n = len(cells)
    if count >= n:
        return cells
    drawn_by = {
        "uniform": np.full(n, 1.0 / n),
        "light": mean_share(cells.weights),
        "energy": mean_share(cells.targets),
    }
    probability = sum((share * drawn_by[name] for name, share in SHARES.items()), np.zeros(n))
    cumulative = np.cumsum(probability)
    rng = np.random.default_rng(seed)
    offset = rng.random()
    points = (np.arange(count) + offset) / count * cumulative[-1]
    drawn = np.minimum(np.searchsorted(cumulative, points), n - 1)
    # Every so many-th draw, from a random one, is a sample of its own; its cells come first.
    coarse_drawn = drawn[min(int(rng.integers(COARSE)), count - 1) :: COARSE]
    coarse, coarse_times = np.unique(coarse_drawn, return_counts=True)
    cells_drawn, times = np.unique(drawn, return_counts=True)
    first = np.isin(cells_drawn, coarse)
    order = np.concatenate([np.flatnonzero(first), np.flatnonzero(~first)])
    chosen = cells_drawn[order]
    expected = count * probability[chosen]
    coarse_expected = len(coarse_drawn) * probability[coarse]
    return cells.take(chosen, times[order], times[order] / expected, coarse_times / coarse_expected)


def mean_share(rows: NDArray[np.float32]) -> Array:
    """Each cell's share (n,) of the squared sum of a row (rows, n), the mean over rows; sums to 1 at most."""
    squares = np.square(rows, dtype=np.float64)
    totals = squares.sum(axis=1, keepdims=True)
    return np.mean(np.divide(squares, totals, out=np.zeros_like(squares), where=totals > 0), axis=0)
