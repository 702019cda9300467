"""How a fit is done unless somebody says otherwise: on how many cells, within which bounds, how hard it tries."""

from collections.abc import Mapping
from dataclasses import dataclass

Bounds = Mapping[str, tuple[float, float]]
"""Closed interval per parameter, `p0`..; a positive lower bound makes a simplex search its logarithm."""

Intervals = tuple[tuple[str, float, float], ...]
"""The same as a value that can be hashed: name, low, high of every parameter."""

CELLS = 2048
"""Cells of the small sample, on which every candidate of a search is fitted first."""

CONFIRM_CELLS = 16384
"""Cells of the large sample, on which what may be kept is fitted thoroughly."""

BOUNDS = (1e-6, 1e5)
"""Of every parameter of an expression that is no published formula; those state bounds of their own."""


@dataclass(frozen=True)
class FitSettings:
    """How hard a fit tries.

    starts:      points at which every target is tried once
    restarts:    simplex descents per target
    rounds:      of further descents, each from the optimum of another target
    evaluations: per descent and searched parameter
    tolerance:   relative spread of the objective over a converged simplex
    """

    starts: int = 256
    restarts: int = 2
    rounds: int = 2
    evaluations: int = 30
    tolerance: float = 1e-4

    def thorough(self) -> "FitSettings":
        """The settings for the few expressions whose fit is kept: some twenty times the work."""
        return FitSettings(
            starts=4 * self.starts,
            restarts=8 * self.restarts,
            rounds=self.rounds + 2,
            evaluations=2 * self.evaluations,
            tolerance=0.1 * self.tolerance,
        )


def intervals(bounds: Bounds) -> Intervals:
    """Bounds as a value that can be hashed."""
    return tuple((name, low, high) for name, (low, high) in bounds.items())
