"""A formula as machine code for one pair of directions: what one would write by hand for a renderer.

The graph is the fit engine's (`fitters.engine.graph`, regrouped): equal subexpressions are one, what depends on
directions alone is computed once for all channels, and what depends on parameters alone is a number that is
prepared with the material and read. LLVM gets it node by node, with the engine's liberties in arithmetic.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from fitters.engine.graph import APPLY, CELL, CONSTANT, MIXED, SCALAR, ZERO_LOG, Graph, add_expression
from fitters.engine.math32 import FLAGS
from fitters.engine.regroup import regroup
from fitters.expressions import Expression
from fitters.grid import Array

CHANNELS = range(3)

_FLAGS = tuple(sorted(FLAGS))
_DOUBLE, _INTEGER = ir.DoubleType(), ir.IntType(64)
_INFIX = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_INTRINSICS = {name: f"llvm.{name}" for name in ("sin", "cos", "exp", "sqrt", "pow", "log")}
_INTRINSICS |= {"max": "llvm.maximum", "min": "llvm.minimum"}
"""maximum and minimum are NaN where an operand is."""


@dataclass(frozen=True, eq=False)
class FormulaCode:
    """The regrouped graph of an expression, and which of its nodes it reads: those of parameters alone."""

    graph: Graph
    root: int
    read: tuple[int, ...]
    names: tuple[str, ...]

    @classmethod
    def of(cls, expression: Expression) -> "FormulaCode":
        first = Graph()
        graph, (root,) = regroup(first, [add_expression(first, expression)])
        wanted = {child for node in graph.reachable([root]) for child in graph.children(node)} | {root}
        used = {
            child
            for node in graph.reachable([root])
            if graph.classes[node] == MIXED
            for child in graph.children(node)
        }
        read = tuple(
            node for node in sorted(wanted) if graph.classes[node] == SCALAR and (node in used or node == root)
        )
        return cls(graph, root, read, expression.parameters)

    def prepared(self, parameters: Array) -> Array:
        """What the code reads of a material, (3, reads) at least (3, 1), of parameters (3, k) in their order."""
        given = dict(zip(self.names, np.asarray(parameters, np.float64).T, strict=True))
        values: dict[int, Array] = {}
        with np.errstate(all="ignore"):
            for node in self.graph.reachable(self.read):
                operator, *rest = self.graph.nodes[node]
                if operator == "const":
                    values[node] = np.asarray(rest[0])
                elif operator == "param":
                    values[node] = given[rest[0]]
                else:
                    values[node] = APPLY[operator](*(values[child] for child in rest))
        prepared = np.zeros((len(CHANNELS), max(len(self.read), 1)))
        for column, node in enumerate(self.read):
            prepared[:, column] = values[node]
        return prepared

    def function(self) -> Callable[[int, int, int, int], None]:
        """For compiled callers: (addresses of w_i, w_o, the tables' addresses, values) -> None.

        The one table is `prepared`.
        """

        @intrinsic
        def formula(typing_context, w_i, w_o, tables, values):
            def generate(context, builder, signature, arguments):
                _Emission(self, builder, arguments).all()
                return context.get_dummy_value()

            return types.void(*[types.int64] * 4), generate

        return formula


class _Emission:
    """The instructions of a formula, written through an LLVM builder."""

    def __init__(self, code: FormulaCode, builder: Any, arguments: list[Any]) -> None:
        self.code, self.graph, self.builder = code, code.graph, builder
        pointer = _DOUBLE.as_pointer()
        self.w_i, self.w_o, self.out = (builder.inttoptr(arguments[k], pointer) for k in (0, 1, 3))
        self.prepared = builder.inttoptr(
            builder.load(builder.inttoptr(arguments[2], _INTEGER.as_pointer())), pointer
        )

    def all(self) -> None:
        i, o = ([self._load(w, k) for k in range(3)] for w in (self.w_i, self.w_o))
        with self.builder.if_else(self._lit(i, o)) as (lit, dark):
            with lit:
                self._shade(i, o)
            with dark:
                for channel in CHANNELS:
                    self._store(channel, self._number(0.0))

    def _shade(self, i: list[Any], o: list[Any]) -> None:
        graph, order = self.graph, self.graph.reachable([self.code.root])
        seen = {graph.nodes[node][1] for node in order if graph.nodes[node][0] == "feature"}
        features = self._features(i, o, seen)
        shared = {}
        for node in order:
            if graph.classes[node] == CONSTANT:
                shared[node] = self._number(graph.value(node))
            elif graph.classes[node] == CELL:
                operator, *rest = graph.nodes[node]
                shared[node] = features[rest[0]] if operator == "feature" else self._apply(node, shared)
        for channel in CHANNELS:
            values = dict(shared)
            for column, node in enumerate(self.code.read):
                values[node] = self._load(self.prepared, channel * max(len(self.code.read), 1) + column)
            for node in order:
                if graph.classes[node] == MIXED:
                    values[node] = self._apply(node, values)
            self._store(channel, self._shown(values[self.code.root]))

    def _features(self, i: list[Any], o: list[Any], wanted: set[str]) -> dict[str, Any]:
        """What the formula sees of the directions, and no other."""
        found = {"wi.z": i[2], "wo.z": o[2]}
        if "wi.wo" in wanted:
            found["wi.wo"] = self._cosine(self._dot(i, o))
        if wanted & {"wo.wr", "wh.wr"}:
            mirror = [self.builder.fneg(i[0]), self.builder.fneg(i[1]), i[2]]
        if "wo.wr" in wanted:
            found["wo.wr"] = self._cosine(self._dot(mirror, o))
        if wanted & {"wh.z", "wi.wh", "wh.wr"}:
            h = [self._operate("add", a, b) for a, b in zip(i, o, strict=True)]
            length = self._operate("sqrt", self._dot(h, h))
            found["wh.z"] = self._at_most_1(self._operate("div", h[2], length))
            # |w_i + w_o| = 2 cos(theta_d).
            found["wi.wh"] = self._at_most_1(self._operate("mul", self._number(0.5), length))
            if "wh.wr" in wanted:
                found["wh.wr"] = self._cosine(self._operate("div", self._dot(mirror, h), length))
        return found

    def _apply(self, node: int, values: dict[int, Any]) -> Any:
        operator, *children = self.graph.nodes[node]
        return self._operate(operator, *(values[child] for child in children))

    def _operate(self, operator: str, *operands: Any) -> Any:
        """One of the graph's operators."""
        if operator == "neg":
            return self.builder.fneg(operands[0], flags=_FLAGS)
        if operator in _INFIX:
            return getattr(self.builder, _INFIX[operator])(*operands, flags=_FLAGS)
        module, kind = self.builder.module, ir.FunctionType(_DOUBLE, [_DOUBLE] * len(operands))
        if operator in _INTRINSICS:
            function = module.declare_intrinsic(_INTRINSICS[operator], [_DOUBLE], kind)
        else:
            # tan, asin, acos and atan of the C library.
            function = module.globals.get(operator) or ir.Function(module, kind, operator)
        value = self.builder.call(function, operands, fastmath=_FLAGS)
        if operator == "log":
            # As the engine's: finite at 0, so that 0^0 stays 1.
            zero = self.builder.fcmp_ordered("==", operands[0], self._number(0.0))
            value = self.builder.select(zero, self._number(ZERO_LOG), value)
        return value

    def _lit(self, i: list[Any], o: list[Any]) -> Any:
        """Whether both directions lie above the horizon; a NaN or infinity in one is no direction."""
        total = i[0]
        for part in (i[1], o[0], o[1]):
            total = self.builder.fadd(total, part)
        finite = self.builder.fcmp_ordered("<", self._absolute(total), self._number(math.inf))
        for w in (i, o):
            finite = self.builder.and_(finite, self.builder.fcmp_ordered(">", w[2], self._number(0.0)))
        return finite

    def _shown(self, value: Any) -> Any:
        """What a model shows of a value: 0 for what is negative or not finite."""
        positive = self.builder.fcmp_ordered(">", value, self._number(0.0))
        finite = self.builder.fcmp_ordered("<", value, self._number(math.inf))
        return self.builder.select(self.builder.and_(positive, finite), value, self._number(0.0))

    def _dot(self, a: list[Any], b: list[Any]) -> Any:
        x, y, z = (self._operate("mul", p, q) for p, q in zip(a, b, strict=True))
        return self._operate("add", self._operate("add", x, y), z)

    def _cosine(self, value: Any) -> Any:
        least = self._number(-1.0)
        value = self._at_most_1(value)
        return self.builder.select(self.builder.fcmp_ordered(">", value, least), value, least)

    def _at_most_1(self, value: Any) -> Any:
        one = self._number(1.0)
        return self.builder.select(self.builder.fcmp_ordered("<", value, one), value, one)

    def _absolute(self, value: Any) -> Any:
        kind = ir.FunctionType(_DOUBLE, [_DOUBLE])
        return self.builder.call(self.builder.module.declare_intrinsic("llvm.fabs", [_DOUBLE], kind), [value])

    def _number(self, value: float | None) -> Any:
        return ir.Constant(_DOUBLE, value)

    def _load(self, pointer: Any, k: int) -> Any:
        return self.builder.load(self.builder.gep(pointer, [ir.Constant(_INTEGER, k)]))

    def _store(self, k: int, value: Any) -> None:
        self.builder.store(value, self.builder.gep(self.out, [ir.Constant(_INTEGER, k)]))
