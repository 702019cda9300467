"""A measured reflectance on the half/difference grid, and how raw samples become one."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, Array, above_horizon

RGB = tuple[float, float, float]

MANY_NEGATIVE = 0.05
"""From this share of negative samples on, setting them to 0 makes dark values too bright."""

FILLED = 0.2
"""From this share of repeated values on they look filled in; a material that is the same everywhere does not."""


@dataclass(frozen=True, eq=False)
class Material:
    """One measured (or built-in) reflectance.

    `table` (3, 90, 90, 180) float32, sr^-1, RGB: finite, not negative, 0 where not valid. `valid`
    (90, 90, 180) is the mask. `source` says where it comes from. `sha256` is the hash of the content that it
    was made from; it is part of the keys of caches. `negative` is, per channel, the share of valid cells whose
    sample was below zero and was set to 0. `spikes` and `dropouts` count the cells that
    `fitters.materials.outliers` has left out.
    """

    name: str
    table: Array
    valid: NDArray[np.bool_]
    source: str
    sha256: str
    negative: RGB
    spikes: int = 0
    dropouts: int = 0

    def __post_init__(self) -> None:
        if self.table.shape != (3, *SHAPE) or self.table.dtype != np.float32:
            raise FittersError(
                f"{self.name}: a table is float32 (3, 90, 90, 180), not {self.table.dtype} {self.table.shape}"
            )
        if self.valid.shape != SHAPE or self.valid.dtype != np.bool_:
            raise FittersError(
                f"{self.name}: a mask is bool (90, 90, 180), not {self.valid.dtype} {self.valid.shape}"
            )
        if not self.valid.any():
            raise FittersError(f"{self.name}: no cell is valid")
        # NaN fails the first comparison, infinity the second.
        if not (self.table.min() >= 0 and self.table.max() < np.inf):
            raise FittersError(f"{self.name}: the table holds negative, NaN or infinite values")
        if np.any(self.table[:, ~self.valid]):
            raise FittersError(f"{self.name}: the table is not 0 where a cell is not valid")

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """What a user who fits the material should know of its samples, in sentences."""
        doubts = []
        if max(self.negative) > MANY_NEGATIVE:
            share = f"{max(self.negative):.0%}"
            doubts.append(f"{share} of its samples were below zero and set to 0: what is dark in it is noise")
        if self.spikes:
            doubts.append(f"{self.spikes:,} isolated spikes were taken for not measured")
        if self.dropouts:
            doubts.append(
                f"{self.dropouts:,} zeros, many of them between bright cells, were taken for not measured"
            )
        if FILLED < (held := self._held_share()) < 1 - FILLED:
            doubts.append(
                f"{held:.0%} of its cells repeat the value before them along theta_diff: they look filled in, not "
                "measured"
            )
        return tuple(doubts)

    def _held_share(self) -> float:
        """The share of cells that repeat the positive value of the one before them, where both are valid."""
        repeats = (self.table[:, :, 1:] == self.table[:, :, :-1]).all(axis=0) & self.table[:, :, 1:].any(axis=0)
        both = self.valid[:, 1:] & self.valid[:, :-1]
        return float(np.sum(repeats & both) / max(int(np.sum(both)), 1))


def from_samples(
    name: str, samples: Array, *, source: str, sha256: str, all_negative_is_missing: bool = False
) -> Material:
    """A material from raw samples (3, 90, 90, 180) in sr^-1; its arrays are copies and read-only.

    A cell is valid where its centre lies above the horizon and its three channels are finite in float32; with
    `all_negative_is_missing`, three negative channels mark a cell that was not measured, as in MERL files.
    Other samples below zero in a valid cell (noise, or a colour outside the gamut) are set to 0 and counted.

    Raises `FittersError` where no cell is valid.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        table = np.array(samples, np.float32)
    above = above_horizon()
    finite = np.isfinite(table).all(axis=0)
    below_zero = table < 0
    valid = above & finite
    if all_negative_is_missing:
        valid &= ~below_zero.all(axis=0)
    if not valid.any():
        count, unusable = np.count_nonzero(above), np.count_nonzero(above & ~finite)
        raise FittersError(
            f"{name}: none of its {CELLS:,} cells is usable: of {count:,} above the horizon, {unusable:,} "
            "are NaN or infinite and the others negative. It holds no measurement: fetch it again."
        )
    negative = np.count_nonzero(below_zero & valid, axis=(1, 2, 3)) / np.count_nonzero(valid)
    table[below_zero | ~valid] = 0.0
    table.flags.writeable = valid.flags.writeable = False
    r, g, b = (float(share) for share in negative)
    return Material(name, table, valid, source, sha256, (r, g, b))
