"""The fit of a formula some of whose parameters are tied: one sum of squares over all targets.

Tied targets have one set of normal equations: J^T J and J^T r of each, added up at the numbers that it uses.
What ties do not connect is fitted apart.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fitters.backends.double import Double
from fitters.backends.program import lower
from fitters.engine.coordinates import Coordinates
from fitters.engine.prepared import linear_units
from fitters.expressions import Expression
from fitters.fitting.cell_fit import Fit
from fitters.fitting.cells import Cells
from fitters.fitting.least_squares import LeastSquares, stepped
from fitters.fitting.polish import TargetSquares
from fitters.fitting.settings import Bounds
from fitters.fitting.sharing.sharing import SCOPES, Sharing
from fitters.grid import CHANNELS, Array
from fitters.judging.metrics import Residual

DESCENTS = 3
"""From the best of the starts."""

EXAMPLES = 6
"""Targets whose own values are tried as everybody's, at most, evenly chosen."""


def tied_fit(
    expression: Expression, cells: Cells, metric: Residual, bounds: Bounds, sharing: Sharing, near: Fit
) -> Fit:
    """The fit over the cells with parameters shared, by Gauss-Newton in float64 from a fit that shares less.

    Its `values` repeat what is shared. Targets are material by material, three channels each. Of a group of tied
    targets without a finite fit nothing changes but the errors, which are infinite.
    """
    program = lower(expression)
    engine, coordinates = Double(program, cells.features), Coordinates(program, bounds)
    units = linear_units(program, cells.units)
    slots = sharing.slots(coordinates.names, len(cells.weights))
    values, errors = near.values.copy(), np.full(len(cells.weights), np.inf)
    for group in _groups(sharing, len(errors)):
        # One number has one unit: that of the middle target.
        unit = 1.0 if units is None else float(np.sort(units[group])[len(group) // 2])
        parts = [TargetSquares(engine, coordinates, cells.weights[t], cells.targets[t], unit) for t in group]
        tied = _Tied(parts, slots[group], coordinates.searched)
        before = np.array([parts[0].place(near.parameters(target)) for target in group])
        y = tied.best(_starts(before, tied.slots))
        squares = [part.normal_equations(y[at])[0] for part, at in zip(parts, tied.slots, strict=True)]
        errors[group] = np.sqrt(squares)
        if np.isfinite(squares).all():
            named = [parts[0].parameters(y[at]) for at in tied.slots]
            values[group] = [[one[name] for name in near.names] for one in named]
    return replace(near, values=values, errors=errors, error=metric.combine(errors))


def _groups(sharing: Sharing, targets: int) -> list[NDArray[np.int64]]:
    """Targets that are fitted together: all, those of a material, or each alone."""
    widest = max(map(SCOPES.index, sharing.scopes), default=0)
    size = (1, len(CHANNELS), targets)[widest]
    return [np.arange(first, first + size) for first in range(0, targets, size)]


def _starts(values: Array, slots: NDArray[np.int64]) -> list[Array]:
    """Stored numbers to begin from, of each target's own values (targets, d): medians, and examples."""
    order = np.argsort(slots, axis=None, kind="stable")
    runs = np.split(values.ravel()[order], np.flatnonzero(np.diff(slots.ravel()[order])) + 1)
    starts = [np.array([np.median(run) for run in runs if len(run)])]
    if not slots.size or len(runs) == slots.size:
        return starts
    for example in np.unique(np.linspace(0, len(values) - 1, EXAMPLES).round().astype(int)):
        start = starts[0].copy()
        # Of a material other than the example's, the same channel stands for it; the example itself comes last.
        for target in (*range(example % len(CHANNELS), len(values), len(CHANNELS)), example):
            start[slots[target]] = values[target]
        starts.append(start)
    return starts


class _Tied(LeastSquares):
    """The sum of several targets' squares, in stored numbers of which `slots` (targets, d) says who uses which."""

    def __init__(self, parts: Sequence[TargetSquares], slots: NDArray[np.int64], searched: int) -> None:
        self.parts, self.searched = parts, searched
        used, compact = np.unique(slots, return_inverse=True)
        self.slots = compact.reshape(slots.shape)
        self.box = np.empty((2, len(used)))
        self.box[:, self.slots] = parts[0].box[:, None, :]

    def normal_equations(self, z: Array) -> tuple[float, Array, Array]:
        squares, gram, slope = 0.0, np.zeros((len(z), len(z))), np.zeros(len(z))
        for part, at in zip(self.parts, self.slots, strict=True):
            own, own_gram, own_slope = part.normal_equations(z[at])
            squares += own
            gram[np.ix_(at, at)] += own_gram
            slope[at] += own_slope
        return squares, gram, slope

    def best(self, starts: Sequence[Array]) -> Array:
        """The best numbers that descents from the best starts reach."""
        different = dict(zip((start.tobytes() for start in starts), starts, strict=True)).values()
        ranked = sorted((self._projected(start) for start in different), key=lambda end: end[1])
        return min((self.descend(z) for z, _ in ranked[:DESCENTS]), key=lambda end: end[1])[0]

    def _projected(self, z: Array) -> tuple[Array, float]:
        """z with the linear parameters solved for what the others are, and the sum of squares."""
        squares, gram, slope = self.normal_equations(z)
        if not len(z) or not np.isfinite(squares):
            return z, squares
        pinned = self.box.copy()
        fixed = np.unique(self.slots[:, : self.searched])
        pinned[:, fixed] = z[fixed]
        solved = stepped(z, gram, slope, 0.0, pinned)
        solved_squares = self.normal_equations(solved)[0]
        return (solved, solved_squares) if solved_squares < squares else (z, squares)
