"""The coordinates in which parameters are searched: the logarithm where a lower bound is positive."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fitters.backends.program import Program
from fitters.grid import Array


class Coordinates:
    """Of all parameters of a program: the searched ones, then the linear ones, which are their own coordinates.

    box: (2, searched + linear) lower and upper bounds
    logarithmic: (searched + linear,) which coordinates are logarithms
    """

    def __init__(self, program: Program, bounds: Mapping[str, tuple[float, float]]) -> None:
        self.names = (*program.searched, *program.linear)
        self.searched = len(program.searched)
        self.box = np.array([bounds[name] for name in self.names], np.float64).reshape(-1, 2).T.copy()
        self.logarithmic = (self.box[0] > 0) & (np.arange(len(self.names)) < self.searched)
        self.box[:, self.logarithmic] = np.log(self.box[:, self.logarithmic])

    def of(self, parameters: Mapping[str, Array | float]) -> NDArray[np.float64]:
        """Coordinates (..., searched + linear) of parameters, each (...), moved into the box."""
        shape = np.shape(next(iter(parameters.values()))) if parameters else ()
        z = np.empty((*shape, len(self.names)))
        for i, name in enumerate(self.names):
            z[..., i] = parameters[name]
        z[..., self.logarithmic] = np.log(np.maximum(z[..., self.logarithmic], 1e-300))
        return np.clip(np.nan_to_num(z), self.box[0], self.box[1])

    def parameters(self, z: Array) -> dict[str, Array]:
        """Parameters, each (...), of coordinates (..., searched + linear); in order of number."""
        values = np.where(self.logarithmic, np.exp(np.where(self.logarithmic, z, 0.0)), z)
        named = {name: values[..., i] for i, name in enumerate(self.names)}
        return dict(sorted(named.items(), key=lambda item: int(item[0][1:])))
