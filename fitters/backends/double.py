"""A program's outputs in float64, by NumPy: for the few evaluations on which a last digit depends."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fitters.backends.program import Program
from fitters.expressions.evaluation import Evaluator
from fitters.expressions.lowered import CELL, MIXED
from fitters.grid import Array

BLOCK = 8192
"""Cells per block: a dozen vectors of it fit the second-level cache."""


class Double:
    """The outputs of a program over cells with these features, each (n,) float64."""

    def __init__(self, program: Program, features: Mapping[str, Array]) -> None:
        form, classes = program.form, program.form.classes
        self.program = program
        order = form.reachable(program.roots)
        read = {child for node in order if classes[node] == MIXED for child in form.children(node)}
        wanted = sorted(read | set(program.roots))
        cells = [node for node in wanted if classes[node] == CELL]
        self._once = [node for node in wanted if classes[node] not in (CELL, MIXED)]
        self._cells = dict(zip(cells, Evaluator(form, cells).run(features=features), strict=True))
        self._scalars = Evaluator(form, self._once)
        self._outputs = Evaluator(form, program.roots, {*self._once, *cells})
        self._count = len(features["wi.z"])
        self.blocks = [slice(at, at + BLOCK) for at in range(0, self._count, BLOCK)]

    def scalars(self, parameters: Mapping[str, Array]) -> dict[int, Array]:
        """Values of the nodes that depend on no cell and are read, at parameters by name."""
        return dict(zip(self._once, self._scalars.run(parameters), strict=True))

    def outputs(self, scalars: Mapping[int, Array], block: slice) -> tuple[Array, NDArray[np.float64]]:
        """Offset (m,) and coefficients (linear, m) over a block of cells."""
        given = dict(scalars) | {node: values[block] for node, values in self._cells.items()}
        size = len(range(*block.indices(self._count)))
        rows = [np.broadcast_to(values, size) for values in self._outputs.run(given=given)]
        linear = len(self.program.linear)
        offset = rows[0] if len(rows) > linear else np.zeros(size)
        return offset, np.stack(rows[-linear:]) if linear else np.empty((0, size))
