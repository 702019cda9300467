"""How well a scene determines the parameters of a fit: the condition number, and directions that change nothing.

The Gauss-Newton matrix J^T J at the optimum, in relative changes of the parameters and with every column of J
scaled to unit length, which no choice of units touches (van der Sluis 1969). The square root of its condition
number says by how much an error of the data is magnified in the parameters.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fitters.expressions import Expression
from fitters.fitting.cell_fit import Fit
from fitters.fitting.cells import Cells
from fitters.fitting.polish import TargetSquares, targets_of
from fitters.fitting.settings import Bounds
from fitters.grid import Array

FLAT = 1e3
"""From this condition number on, data that are off by 0.1 % may move parameters by as much as they do at all."""
NEGLIGIBLE = 1e-6
"""A parameter whose whole effect on a target is this share of the largest one's, or less, is as good as absent."""
WORKS = 1e-3
"""At a bound, a parameter with a smaller share is switched off rather than stuck."""
BESIDE = 1e-9
"""A coordinate this near a side of the box is on it."""
PART = 0.1
"""What of a flat direction is named: parameters that change by this share of the one that changes most."""


@dataclass(frozen=True)
class Conditioning:
    """One target. `condition` >= 1, 1 for one parameter; 3e7 stands for all above, infinite where J is not finite.

    flat:      per flat direction, by parameter the relative change of each, the largest 1 or -1
    idle:      parameters without an effect
    at_bounds: those that have one and stand at a side of their interval, with that side
    """

    condition: float
    flat: tuple[dict[str, float], ...]
    idle: tuple[str, ...]
    at_bounds: dict[str, float]


def conditioning(expression: Expression, cells: Cells, bounds: Bounds, fit: Fit) -> list[Conditioning]:
    """Of every target of a fit, on some cells."""
    problems = targets_of(expression, cells, bounds)
    return [_of_target(problem, bounds, fit.parameters(target)) for target, problem in enumerate(problems)]


def _of_target(problem: TargetSquares, bounds: Bounds, parameters: dict[str, float]) -> Conditioning:
    z = problem.place(parameters)
    _, gram, _ = problem.normal_equations(z)
    names = problem.coordinates.names
    # Relative changes: logarithms are that already.
    per_unit = np.where(problem.coordinates.logarithmic, 1.0, np.abs(z))
    effect = np.sqrt(np.maximum(np.diag(gram), 0.0)) * per_unit
    if not np.all(np.isfinite(effect)):
        return Conditioning(np.inf, (), names, {})
    active = effect > NEGLIGIBLE * effect.max(initial=0.0)
    idle = tuple(name for name, works in zip(names, active, strict=True) if not works)
    condition, flat = _spectrum(gram * np.outer(per_unit, per_unit), effect, np.flatnonzero(active), names)
    low, high = problem.coordinates.box
    works = effect > WORKS * effect.max(initial=0.0)
    lowest, highest = works & (z <= low + BESIDE), works & (z >= high - BESIDE)
    at = {name: bounds[name][0] for name, stuck in zip(names, lowest, strict=True) if stuck}
    at |= {name: bounds[name][1] for name, stuck in zip(names, highest, strict=True) if stuck}
    return Conditioning(condition, flat, idle, at)


def _spectrum(
    gram: Array, effect: Array, active: NDArray[np.intp], names: tuple[str, ...]
) -> tuple[float, tuple[dict[str, float], ...]]:
    if len(active) == 0:
        return 1.0, ()
    scale = effect[active]
    values, vectors = np.linalg.eigh(gram[np.ix_(active, active)] / np.outer(scale, scale))
    # Rounding leaves eigenvalues of 0 at about 1e-16 of the largest: no condition number above 3e7 is known.
    conditions = np.sqrt(values[-1] / np.maximum(values, 1e-15 * values[-1]))
    flat = tuple(_named(vectors[:, i] / scale, active, names) for i in range(len(values)) if conditions[i] > FLAT)
    return float(conditions[0]), flat


def _named(direction: Array, active: NDArray[np.intp], names: tuple[str, ...]) -> dict[str, float]:
    largest = direction[np.argmax(np.abs(direction))]
    parts = {names[place]: float(part / largest) for place, part in zip(active, direction, strict=True)}
    return {name: part for name, part in sorted(parts.items()) if abs(part) >= PART}
