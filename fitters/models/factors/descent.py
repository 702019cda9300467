"""Levenberg-Marquardt on the logarithms of factors: the solver that converges.

The unknowns of a problem are rho_d, then logarithms of factors. A factor's components stay within a dynamic range
of its largest (section 4.3 of Bagher et al. 2016): what lies at the lower end and would fall further is held for
the step. The objective never rises.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from fitters.grid import Array
from fitters.models.factors.samples import Samples

LARGEST_FALL = 3.0
"""No logarithm falls by more in a step."""
NEGLIGIBLE = 1e-12
"""An objective of this share of the weighted squared measurement is as good as 0: that is in float32."""
PATIENCE = 2
"""Steps in a row that must each gain less than the tolerance before a descent ends."""


class LogProblem(Protocol):
    """An objective over unknowns x (k,): rho_d >= 0, then logarithms."""

    @property
    def samples(self) -> Samples: ...

    def objective(self, x: Array) -> float: ...

    def normal_equations(self, x: Array) -> tuple[float, Array, Array]:
        """The objective, half its gradient (k,), and its Gauss-Newton matrix (k, k)."""
        ...

    def bounds(self, x: Array) -> tuple[Array, Array]:
        """The box (k,), (k,) near x."""
        ...

    def in_box(self, x: Array) -> Array:
        """The nearest unknowns that the model allows."""
        ...


@dataclass(frozen=True, eq=False)
class Descent:
    """Where a descent ended: unknowns, the objective there and after every step, whether the gain had run out."""

    x: Array
    objective: float
    course: tuple[float, ...]
    converged: bool

    @property
    def iterations(self) -> int:
        return len(self.course) - 1


def descend(problem: LogProblem, x: Array, *, iterations: int, tolerance: float) -> Descent:
    """Descends until steps gain less than `tolerance` of the objective, or `iterations` are used up."""
    x = problem.in_box(x)
    damping, small = 1e-3, 0
    course = [problem.objective(x)]
    negligible = NEGLIGIBLE * problem.samples.square
    while len(course) <= iterations:
        if course[-1] <= negligible:
            return Descent(x, course[-1], tuple(course), True)
        value, gradient, matrix = problem.normal_equations(x)
        low, high = problem.bounds(x)
        free = np.flatnonzero(((x > low + 1e-12) | (gradient < 0)) & ((x < high - 1e-12) | (gradient > 0)))
        step = _step(problem, x, value, gradient, matrix, free, damping)
        if step is None:
            return Descent(x, value, tuple(course), True)
        x, lower, damping = step
        course.append(lower)
        small = small + 1 if value - lower <= tolerance * value else 0
        if small == PATIENCE:
            return Descent(x, lower, tuple(course), True)
    return Descent(x, course[-1], tuple(course), False)


def _step(
    problem: LogProblem,
    x: Array,
    value: float,
    gradient: Array,
    matrix: Array,
    free: NDArray[np.intp],
    damping: float,
) -> tuple[Array, float, float] | None:
    """The first step that lowers the objective: unknowns, objective, next damping; None where there is none."""
    diagonal = np.diag(matrix)
    # What no sample sees has no curvature: it is left where it is.
    scale = 1.0 / np.sqrt(np.maximum(diagonal, 1e-12 * diagonal[1:].max()))[free]
    reduced = matrix[np.ix_(free, free)] * scale[:, None] * scale[None, :]
    right = scale * gradient[free]
    growth = 2.0
    while damping < 1e8:
        damped = reduced.copy()
        damped[np.diag_indices(len(free))] += damping
        change = np.zeros_like(x)
        try:
            change[free] = -scale * cho_solve(cho_factor(damped, overwrite_a=True, check_finite=False), right)
        except LinAlgError:
            damping, growth = max(damping, 1e-12) * growth, 2 * growth
            continue
        change[1:] = _tempered(change[1:])
        trial = problem.in_box(x + change)
        lower = problem.objective(trial)
        if lower < value:
            expected = -float(2 * gradient @ change + change @ matrix @ change)
            gain = (value - lower) / max(expected, 1e-300)
            return trial, lower, max(damping * max(1 / 9, 1 - (2 * min(gain, 2.0) - 1) ** 3), 1e-10)
        damping, growth = damping * growth, 2 * growth
    return None


def _tempered(change: Array) -> Array:
    """A step of logarithms, taken less far where it would rise by more than 1.

    The step is linear in the factors themselves: a component far below where it belongs sees a relative change of
    many powers of e, which is meant as a multiple.
    """
    risen = 1.0 + np.log(np.maximum(change, 1.0))
    return np.where(change > 1.0, risen, np.maximum(change, -LARGEST_FALL))
