"""The last polish of a fit that is kept: Gauss-Newton over all its parameters, on all cells, in float64.

What Nelder-Mead has found in float32 is near the optimum; from there a few steps of Gauss and Newton, damped after
Levenberg and Marquardt where they must be, go to the end. Derivatives by linear parameters are what the program
computes anyway, those by the others are differences.
"""

from collections.abc import Iterator, Mapping
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
from fitters.fitting.least_squares import LeastSquares
from fitters.fitting.settings import Bounds
from fitters.grid import Array
from fitters.judging.metrics import Residual

DIFFERENCE = 1e-6
"""Step of a difference quotient, in the coordinates that a simplex searches."""


def polish(expression: Expression, cells: Cells, metric: Residual, bounds: Bounds, fit: Fit) -> Fit:
    """The fit with every target's parameters improved on the cells, within the bounds; never worse on them.

    Errors are those of the program in float64. A target without a finite fit stays as it is.
    """
    values, errors = fit.values.copy(), fit.errors.copy()
    for target, problem in enumerate(targets_of(expression, cells, bounds)):
        z, squares = problem.descend(problem.place(fit.parameters(target)))
        if np.isfinite(squares):
            named = problem.parameters(z)
            values[target] = [named[name] for name in fit.names]
            errors[target] = np.sqrt(squares)
    return replace(fit, values=values, errors=errors, error=metric.combine(errors))


def targets_of(expression: Expression, cells: Cells, bounds: Bounds) -> Iterator["TargetSquares"]:
    """The problem of every target of some cells, one after the other."""
    program = lower(expression)
    engine, coordinates = Double(program, cells.features), Coordinates(program, bounds)
    units = linear_units(program, cells.units)
    for target, (weights, targets) in enumerate(zip(cells.weights, cells.targets, strict=True)):
        unit = 1.0 if units is None else float(units[target])
        yield TargetSquares(engine, coordinates, weights, targets, unit)


class TargetSquares(LeastSquares):
    """One target's sum of squares in coordinates z: those of the searched parameters, then the linear ones."""

    def __init__(
        self,
        engine: Double,
        coordinates: Coordinates,
        weights: NDArray[np.float32],
        targets: NDArray[np.float32],
        unit: float = 1.0,
    ) -> None:
        self.engine, self.coordinates, self.unit = engine, coordinates, unit
        self.box = coordinates.box
        self.weights, self.targets = weights.astype(np.float64) * unit, targets.astype(np.float64)

    def place(self, parameters: Mapping[str, float]) -> Array:
        """The coordinates of parameters by name."""
        linear = self.coordinates.names[self.coordinates.searched :]
        return self.coordinates.of(
            {name: value / self.unit if name in linear else value for name, value in parameters.items()}
        )

    def parameters(self, z: Array) -> dict[str, Array]:
        """What `place` makes coordinates of."""
        scale = np.where(np.arange(len(z)) < self.coordinates.searched, 1.0, self.unit)
        return self.coordinates.parameters(z * scale)

    def normal_equations(self, z: Array) -> tuple[float, Array, Array]:
        searched = self.coordinates.searched
        points = [z, *(self._moved(z, i) for i in range(searched))]
        scalars = [self.engine.scalars(self.coordinates.parameters(point)) for point in points]
        steps = np.array([points[1 + i][i] - z[i] for i in range(searched)])
        c = z[searched:]
        squares, gram, slope = 0.0, np.zeros((len(z), len(z))), np.zeros(len(z))
        with np.errstate(all="ignore"):
            for block in self.engine.blocks:
                weights = self.weights[block]
                offset, columns = self.engine.outputs(scalars[0], block)
                value = offset + c @ columns
                jacobian = np.empty((len(z), len(value)))
                for i in range(searched):
                    moved_offset, moved = self.engine.outputs(scalars[1 + i], block)
                    jacobian[i] = (moved_offset + c @ moved - value) / steps[i]
                jacobian[searched:] = columns
                jacobian *= weights
                residual = weights * value - self.targets[block]
                squares += float(residual @ residual)
                gram += jacobian @ jacobian.T
                slope += jacobian @ residual
        finite = np.isfinite(squares) and np.all(np.isfinite(gram)) and np.all(np.isfinite(slope))
        return (squares if finite else np.inf), gram, slope

    def _moved(self, z: Array, i: int) -> Array:
        """z with one coordinate a little off, within the box."""
        moved = z.copy()
        moved[i] += DIFFERENCE if z[i] + DIFFERENCE <= self.box[1, i] else -DIFFERENCE
        return moved
