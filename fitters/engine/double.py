"""A program's outputs in float64, by NumPy: for the few evaluations on which a last digit depends."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fitters.engine.graph import APPLY, CELL, CONSTANT, MIXED, SCALAR
from fitters.engine.program import Program
from fitters.grid import Array

BLOCK = 8192
"""Cells per block: a dozen vectors of it fit the second-level cache."""


class Double:
    """The outputs of a program over cells with these features, each (n,) float64."""

    def __init__(self, program: Program, features: Mapping[str, Array]) -> None:
        self.program = program
        order = program.graph.reachable(program.roots)
        classes = program.graph.classes
        self._once = [node for node in order if classes[node] in (CONSTANT, SCALAR)]
        self._mixed = [node for node in order if classes[node] == MIXED]
        self._cells = self._cell_values(features)
        self.blocks = [slice(at, at + BLOCK) for at in range(0, len(features["wi.z"]), BLOCK)]

    def scalars(self, parameters: Mapping[str, Array]) -> dict[int, Array]:
        """Values of all nodes that depend on no cell, at parameters by name."""
        values: dict[int, Array] = {}
        with np.errstate(all="ignore"):
            for node in self._once:
                operator, *rest = self.program.graph.nodes[node]
                if operator == "const":
                    values[node] = np.asarray(rest[0])
                elif operator == "param":
                    values[node] = parameters[rest[0]]
                else:
                    values[node] = APPLY[operator](*(values[child] for child in rest))
        return values

    def outputs(self, scalars: Mapping[int, Array], block: slice) -> tuple[Array, NDArray[np.float64]]:
        """Offset (m,) and coefficients (linear, m) over a block of cells."""
        values = dict(scalars) | {node: cells[block] for node, cells in self._cells.items()}
        with np.errstate(all="ignore"):
            for node in self._mixed:
                operator, *children = self.program.graph.nodes[node]
                values[node] = APPLY[operator](*(values[child] for child in children))
        size = len(range(*block.indices(self._count)))
        rows = [np.broadcast_to(values[root], size) for root in self.program.roots]
        linear = len(self.program.linear)
        offset = rows[0] if len(rows) > linear else np.zeros(size)
        return offset, np.stack(rows[-linear:]) if linear else np.empty((0, size))

    def _cell_values(self, features: Mapping[str, Array]) -> dict[int, Array]:
        """Values of the cell nodes that others read."""
        graph = self.program.graph
        self._count = len(features["wi.z"])
        read = {child for node in self._mixed for child in graph.children(node)} | set(self.program.roots)
        wanted = sorted(node for node in read if graph.classes[node] == CELL)
        return dict(zip(wanted, self.program.cell_values(features, wanted), strict=True))
