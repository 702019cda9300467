"""Programs: an expression lowered to the register machine's code.

An expression is lowered (`expressions/lowered.py`), split into linear coefficients (`linear.py`), regrouped
(`regroup.py`) and written as code. A program computes its outputs, the offset and one coefficient per linear
parameter:

    f = output[0] + sum over j of linear[j] * output[1 + j]

`scalar_code` runs once per evaluation in float64, `code` per block of cells in float32. What depends on cells
alone is computed once per expression, in float64 by NumPy, and given to the machine as input vectors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fitters.backends.linear import split_linear
from fitters.backends.machine import Operands, scalar_opcode, vector_opcode
from fitters.backends.regroup import regroup
from fitters.expressions.evaluation import Evaluator
from fitters.expressions.expression import Expression
from fitters.expressions.lowered import CELL, CONSTANT, MIXED, SCALAR, Lowered, add_expression
from fitters.expressions.operators import OPERATORS
from fitters.grid import Array

Code = NDArray[np.int32]


@dataclass(frozen=True)
class Program:
    """Code for the machine; every row of code is (opcode, destination, first operand, second operand).

    searched, linear: names of the parameters that a simplex varies, and of those solved in closed form
    scalars:          (s,) initial scalar registers: the searched parameters first, then constants and room
    scalar_code:      (n, 4) over scalar registers
    code:             (n, 4); vector slots are inputs, then outputs, then temporaries
    inputs:           nodes of `form` whose values on the cells the machine reads
    outputs:          (1 + linear,) vector slots; the first is -1 where there is no offset
    roots:            nodes of `form` that the outputs are, the offset first where there is one
    """

    searched: tuple[str, ...]
    linear: tuple[str, ...]
    scalars: NDArray[np.float64]
    scalar_code: Code
    code: Code
    form: Lowered
    inputs: tuple[int, ...]
    outputs: NDArray[np.int32]
    roots: tuple[int, ...]
    persistent: int
    temporaries: int

    def input_vectors(self, features: Mapping[str, Array]) -> NDArray[np.float32]:
        """The machine's inputs (inputs, n) from the features of n cells: computed in float64, held in float32."""
        vectors = np.empty((max(len(self.inputs), 1), len(features["wi.z"])), np.float32)
        with np.errstate(all="ignore"):
            for row, values in enumerate(Evaluator(self.form, self.inputs).run(features=features)):
                vectors[row] = values
        return vectors


@lru_cache(maxsize=256)
def lower(expression: Expression) -> Program:
    """The program of an expression."""
    form = Lowered()
    split = split_linear(form, add_expression(form, expression))
    linear = tuple(name for name in split if name is not None)
    linear = tuple(sorted(linear, key=lambda name: int(name[1:])))
    roots = [split[name] for name in ((None, *linear) if None in split else linear)]
    regrouped, nodes = regroup(form, roots)
    return _Scheduler(regrouped, nodes, linear, has_offset=None in split).program()


def lower_whole(expression: Expression) -> Program:
    """The program that computes all of an expression per cell: no linear split, and features for inputs only."""
    form = Lowered()
    regrouped, nodes = regroup(form, [add_expression(form, expression)])
    for node, operation in enumerate(regrouped.nodes):
        if regrouped.classes[node] == CELL and operation[0] != "feature":
            regrouped.classes[node] = MIXED
    return _Scheduler(regrouped, nodes, (), has_offset=True).program()


class _Scheduler:
    """Orders the nodes of a regrouped form, gives them registers and writes the code."""

    def __init__(self, form: Lowered, roots: list[int], linear: tuple[str, ...], *, has_offset: bool) -> None:
        self.form, self.roots, self.linear, self.has_offset = form, roots, linear, has_offset
        self.order = form.reachable(roots)
        self.mixed = [node for node in self.order if form.classes[node] == MIXED]
        self.searched = tuple(
            sorted(
                (form.nodes[node][1] for node in self.order if form.nodes[node][0] == "param"),
                key=lambda name: int(name[1:]),
            )
        )
        self.scalar_register: dict[int, int] = {}
        self.slot: dict[int, int] = {}

    def program(self) -> Program:
        scalars, scalar_code = self._scalars()
        inputs = self._inputs()
        filled = [root for root in dict.fromkeys(self.roots) if self.form.classes[root] in (CONSTANT, SCALAR)]
        written = [root for root in dict.fromkeys(self.roots) if self.form.classes[root] == MIXED]
        for slot, node in enumerate([*inputs, *filled, *written]):
            self.slot[node] = slot
        persistent = len(inputs) + len(filled) + len(written)
        code = [(vector_opcode("fill", Operands.S), self.slot[n], self.scalar_register[n], 0) for n in filled]
        mixed_code, temporaries = self._vectors(set(written), persistent)
        outputs = [self.slot[root] for root in self.roots]
        return Program(
            searched=self.searched,
            linear=self.linear,
            scalars=scalars,
            scalar_code=scalar_code,
            code=_rows(code + mixed_code),
            form=self.form,
            inputs=tuple(inputs),
            outputs=np.array(outputs if self.has_offset else [-1, *outputs], np.int32),
            roots=tuple(self.roots),
            persistent=persistent,
            temporaries=temporaries,
        )

    def _scalars(self) -> tuple[NDArray[np.float64], Code]:
        """Registers of all scalar and constant nodes that any code reads."""
        wanted = [node for node in self.order if self.form.classes[node] in (CONSTANT, SCALAR)]
        params = [node for node in wanted if self.form.nodes[node][0] == "param"]
        params.sort(key=lambda node: self.searched.index(self.form.nodes[node][1]))
        rest = [node for node in wanted if self.form.nodes[node][0] != "param"]
        self.scalar_register = {node: register for register, node in enumerate([*params, *rest])}
        initial = np.zeros(max(len(wanted), 1))
        code = []
        for node in rest:
            operator, *children = self.form.nodes[node]
            if operator == "const":
                initial[self.scalar_register[node]] = children[0]
            else:
                registers = [self.scalar_register[child] for child in children]
                code.append((scalar_opcode(operator), self.scalar_register[node], registers[0], registers[-1]))
        return initial, _rows(code)

    def _inputs(self) -> list[int]:
        """Cell nodes that mixed nodes read, and outputs that are cell nodes."""
        read = {child for node in self.mixed for child in self.form.children(node)} | set(self.roots)
        return sorted(node for node in read if self.form.classes[node] == CELL)

    def _vectors(self, written: set[int], persistent: int) -> tuple[list[tuple[int, ...]], int]:
        last_use = {child: node for node in self.mixed for child in self.form.children(node)}
        free: list[int] = []
        temporaries = 0
        code = []
        for node in self.mixed:
            operator, *children = self.form.nodes[node]
            if node not in self.slot:
                # Never the slot of an operand of this very node: equal pointers make the loop run scalar.
                if not free:
                    free.append(persistent + temporaries)
                    temporaries += 1
                self.slot[node] = free.pop()
            code.append(self._instruction(operator, self.slot[node], children))
            for child in dict.fromkeys(children):
                is_temporary = self.slot.get(child, 0) >= persistent and child not in written
                if is_temporary and last_use[child] == node:
                    free.append(self.slot[child])
        return code, temporaries

    def _instruction(self, operator: str, destination: int, children: list[int]) -> tuple[int, ...]:
        is_scalar = [self.form.classes[child] in (CONSTANT, SCALAR) for child in children]
        if len(children) == 2 and is_scalar[0] and OPERATORS[operator].commutative:
            children, is_scalar = children[::-1], is_scalar[::-1]
        operands = [
            self.scalar_register[child] if scalar else self.slot[child]
            for child, scalar in zip(children, is_scalar, strict=True)
        ]
        kinds = Operands("".join("s" if scalar else "v" for scalar in is_scalar))
        return vector_opcode(operator, kinds), destination, operands[0], operands[-1]


def _rows(code: Sequence[tuple[int, ...]]) -> Code:
    return np.array(code, np.int32).reshape(-1, 4)
