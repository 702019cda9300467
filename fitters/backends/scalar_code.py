"""A formula as machine code for one pair of directions: what one would write by hand for a renderer.

The lowered form is regrouped as for the machine: equal subexpressions are one, what depends on directions alone is
computed once for all channels, and what depends on parameters alone is a number that is prepared with the material
and read. LLVM gets it node by node, with the machine's liberties in arithmetic.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from fitters.backends.math32 import FLAGS
from fitters.backends.regroup import regroup
from fitters.expressions.evaluation import Evaluator
from fitters.expressions.expression import Expression
from fitters.expressions.lowered import CELL, MIXED, SCALAR, Lowered, Walk, add_expression
from fitters.expressions.operators import ZERO_LOG, spelling
from fitters.grid import Array

CHANNELS = range(3)

_FLAGS = tuple(sorted(FLAGS))
_DOUBLE, _INTEGER = ir.DoubleType(), ir.IntType(64)


@dataclass(frozen=True, eq=False)
class ScalarCode:
    """The regrouped form of an expression.

    read:   its nodes of parameters alone that the code reads
    shared: its nodes of directions alone that are computed once for all channels
    """

    form: Lowered
    root: int
    read: tuple[int, ...]
    shared: tuple[int, ...]
    names: tuple[str, ...]

    @classmethod
    def of(cls, expression: Expression) -> "ScalarCode":
        first = Lowered()
        form, (root,) = regroup(first, [add_expression(first, expression)])
        mixed = [node for node in form.reachable([root]) if form.classes[node] == MIXED]
        wanted = sorted({child for node in mixed for child in form.children(node)} | {root})
        read, shared = (
            tuple(node for node in wanted if form.classes[node] == node_class) for node_class in (SCALAR, CELL)
        )
        return cls(form, root, read, shared, expression.parameters)

    def prepared(self, parameters: Array) -> Array:
        """What the code reads of a material, (3, reads) at least (3, 1), of parameters (3, k) in their order."""
        given = dict(zip(self.names, np.asarray(parameters, np.float64).T, strict=True))
        prepared = np.zeros((len(CHANNELS), max(len(self.read), 1)))
        for column, values in enumerate(Evaluator(self.form, self.read).run(given)):
            prepared[:, column] = values
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

    def __init__(self, code: ScalarCode, builder: Any, arguments: list[Any]) -> None:
        self.code, self.builder = code, builder
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
        code, form = self.code, self.code.form
        features = self._features(i, o, {form.nodes[node][1] for node in form.reachable([code.root])})

        def leaf(kind: str, label: float | str) -> Any:
            return features[str(label)] if kind == "feature" else self._number(float(label))

        values = Walk[Any](form, code.shared).run(leaf, self._operate)
        shared = dict(zip(code.shared, values, strict=True))
        channel_values = Walk[Any](form, [code.root], {*code.read, *code.shared})
        for channel in CHANNELS:
            first = channel * max(len(code.read), 1)
            read = {node: self._load(self.prepared, first + column) for column, node in enumerate(code.read)}
            (value,) = channel_values.run(leaf, self._operate, shared | read)
            self._store(channel, self._shown(value))

    def _features(self, i: list[Any], o: list[Any], wanted: set[Any]) -> dict[str, Any]:
        """The features of the directions that are wanted, `wi.z` and `wo.z` in any case."""
        known = {"wi.z": i[2], "wo.z": o[2]}
        if "wi.wo" in wanted:
            known["wi.wo"] = self._cosine(self._dot(i, o))
        if wanted & {"wo.wr", "wh.wr"}:
            mirror = [self.builder.fneg(i[0]), self.builder.fneg(i[1]), i[2]]
        if "wo.wr" in wanted:
            known["wo.wr"] = self._cosine(self._dot(mirror, o))
        if wanted & {"wh.z", "wi.wh", "wh.wr"}:
            h = [self._operate("add", a, b) for a, b in zip(i, o, strict=True)]
            length = self._operate("sqrt", self._dot(h, h))
            known["wh.z"] = self._at_most_1(self._operate("div", h[2], length))
            # |w_i + w_o| = 2 cos(theta_d).
            known["wi.wh"] = self._at_most_1(self._operate("mul", self._number(0.5), length))
            if "wh.wr" in wanted:
                known["wh.wr"] = self._cosine(self._operate("div", self._dot(mirror, h), length))
        return known

    def _operate(self, operator: str, *operands: Any) -> Any:
        """One operator. Raises `FittersError` for one that this backend has no instruction for."""
        spelled, builder = spelling(operator, "llvm"), self.builder
        if spelled.startswith("f"):
            return getattr(builder, spelled)(*operands, flags=_FLAGS)
        module, kind = builder.module, ir.FunctionType(_DOUBLE, [_DOUBLE] * len(operands))
        if spelled.startswith("llvm."):
            function = module.declare_intrinsic(spelled, [_DOUBLE], kind)
        else:
            name = spelled.removeprefix("call ")
            function = module.globals.get(name) or ir.Function(module, kind, name)
        value = builder.call(function, operands, fastmath=_FLAGS)
        if operator == "log":
            # Finite at 0, so that 0^0 stays 1.
            zero = builder.fcmp_ordered("==", operands[0], self._number(0.0))
            value = builder.select(zero, self._number(ZERO_LOG), value)
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

    def _number(self, value: float) -> Any:
        return ir.Constant(_DOUBLE, value)

    def _load(self, pointer: Any, k: int) -> Any:
        return self.builder.load(self.builder.gep(pointer, [ir.Constant(_INTEGER, k)]))

    def _store(self, k: int, value: Any) -> None:
        self.builder.store(value, self.builder.gep(self.out, [ir.Constant(_INTEGER, k)]))
