"""Cells of the grid as a fit reads them, and samples that stand for all of them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fitters.grid import Array

SHARES = {"uniform": 0.2, "light": 0.3, "energy": 0.5}
"""How sampled cells are drawn: uniformly, by their light alone, by the reflected energy they carry.

Energy is where a good formula is judged, light where a bad one may go wrong unseen.
"""

COARSE = 4
"""One in this many draws of a sample belongs to its coarse part."""


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
    # One draw in COARSE, from a random one on, makes a sample of its own; its cells come first.
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
