"""Gauss-Newton steps within a box, damped after Levenberg and Marquardt where they must be, in float64."""

from abc import ABC, abstractmethod

import numpy as np

from fitters.grid import Array

STEPS = 100
"""At most, with those that do not lower the error. Few formulas take more than twenty; SGD with its ten
parameters does."""

ENOUGH = 1e-7
"""Relative improvement of the sum of squares below which a descent is done."""


class LeastSquares(ABC):
    """A sum of squares in coordinates z (d,), which a box (2, d) bounds."""

    box: Array

    @abstractmethod
    def normal_equations(self, z: Array) -> tuple[float, Array, Array]:
        """Sum of squares r r, J^T J (d, d) and J^T r (d,) at z; not finite where the residual is not."""

    def descend(self, z: Array) -> tuple[Array, float]:
        """The best coordinates from z and their sum of squares; infinite where that is not finite."""
        squares, gram, slope = self.normal_equations(z)
        damping = 0.0
        for _ in range(STEPS if len(z) and np.isfinite(squares) else 0):
            trial = stepped(z, gram, slope, damping, self.box)
            trial_squares, trial_gram, trial_slope = self.normal_equations(trial)
            if not trial_squares < squares:
                damping = max(4.0 * damping, 1e-3)
                continue
            done = squares - trial_squares <= ENOUGH * squares
            z, squares, gram, slope, damping = trial, trial_squares, trial_gram, trial_slope, damping / 3
            if done:
                break
        return z, squares if np.isfinite(squares) else np.inf


def stepped(z: Array, gram: Array, slope: Array, damping: float, box: Array) -> Array:
    """z after one damped step: what would leave the box stops at its side, and the rest allows for that."""
    low, high = box
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    matrix = gram / np.outer(scale, scale) + damping * np.eye(len(z))
    right, step, free = -slope / scale, np.zeros(len(z)), np.ones(len(z), bool)
    while free.any():
        rest = right[free] - matrix[np.ix_(free, ~free)] @ step[~free]
        # Of parameters that do the same, the least-squares solution moves both a little.
        step[free] = np.linalg.lstsq(matrix[np.ix_(free, free)], rest, rcond=1e-12)[0]
        wanted = z + step / scale
        leaves = free & ((wanted < low) | (wanted > high))
        if not leaves.any():
            break
        step[leaves] = ((np.clip(wanted, low, high) - z) * scale)[leaves]
        free &= ~leaves
    return np.clip(z + step / scale, low, high)
