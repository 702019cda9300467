"""Expressions as a graph in single-assignment form: equal subexpressions are one node, constants are folded.

Every node has a class, which says when it must be computed:
    CONSTANT  never, it is a number
    SCALAR    once per evaluation: parameters and constants only
    CELL      once per expression: features of the cells and constants only
    MIXED     per evaluation and cell
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from fitters.expressions import grammar
from fitters.expressions.evaluation import FUNCTIONS, dot_feature
from fitters.expressions.expression import Expression

CONSTANT, SCALAR, CELL, MIXED = range(4)

Node = tuple  # ("const", value), ("param", name), ("feature", name) or (operator, id[, id])

_COMMUTATIVE = frozenset(("add", "mul", "max", "min"))
_LARGEST_POWER = 16
"""Whole powers up to this become products."""


class Graph:
    """Hash-consed nodes, children before parents; node ids are positions in `nodes`."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.classes: list[int] = []
        self._ids: dict[Node, int] = {}

    def const(self, value: float) -> int:
        return self._add(("const", float(value)), CONSTANT)

    def param(self, name: str) -> int:
        return self._add(("param", name), SCALAR)

    def feature(self, name: str) -> int:
        return self._add(("feature", name), CELL)

    def value(self, node: int) -> float | None:
        """The number that a constant node is, None for any other."""
        return self.nodes[node][1] if self.classes[node] == CONSTANT else None

    def emit(self, operator: str, *children: int) -> int:
        """The node of an operation: folded where it is constant, simplified where that keeps every value."""
        classes = self.classes
        kinds = {classes[child] for child in children}
        values: tuple[float | None, float | None] = (None, None)
        if CONSTANT in kinds:
            values = self.value(children[0]), self.value(children[-1])
            if len(kinds) == 1:
                with np.errstate(all="ignore"):
                    return self.const(float(APPLY[operator](*map(np.float64, values[: len(children)]))))
        simpler = self._simpler(operator, children, values)
        if simpler is not None:
            return simpler
        if operator in _COMMUTATIVE and children[0] > children[1]:
            children = children[::-1]
        kinds.discard(CONSTANT)
        return self._add((operator, *children), kinds.pop() if len(kinds) == 1 else MIXED)

    def _simpler(
        self, operator: str, children: tuple[int, ...], values: tuple[float | None, float | None]
    ) -> int | None:
        a, b = children[0], children[-1]
        if operator == "neg" and self.nodes[a][0] == "neg":
            return self.nodes[a][1]
        if operator == "mul":
            if values[0] == 1.0:
                return b
            if values[1] == 1.0:
                return a
        if operator == "add":
            if values[0] == 0.0:
                return b
            if values[1] == 0.0:
                return a
        if (operator == "div" and values[1] == 1.0) or (operator == "sub" and values[1] == 0.0):
            return a
        if operator == "add" and self.nodes[b][0] == "neg":
            return self.emit("sub", a, self.nodes[b][1])
        if operator == "add" and self.nodes[a][0] == "neg":
            return self.emit("sub", b, self.nodes[a][1])
        if operator == "sub" and self.nodes[b][0] == "neg":
            return self.emit("add", a, self.nodes[b][1])
        if operator == "pow":
            return self._power(a, values[1])
        return None

    def _power(self, base: int, exponent: float | None) -> int | None:
        """A whole or half power by products; None where it takes the general operation."""
        if exponent is None or not np.isfinite(exponent):
            return None
        if exponent == 0.5:
            return self.emit("sqrt", base)
        if exponent < 0 and exponent == int(exponent) and -exponent <= _LARGEST_POWER:
            positive = self._power(base, -exponent)
            return None if positive is None else self.emit("div", self.const(1.0), positive)
        if exponent != int(exponent) or not 1 <= exponent <= _LARGEST_POWER:
            return None
        result, square, left = None, base, int(exponent)
        while left:
            if left & 1:
                result = square if result is None else self.emit("mul", result, square)
            left >>= 1
            if left:
                square = self.emit("mul", square, square)
        return result

    def _add(self, node: Node, node_class: int) -> int:
        # 0.0 and -0.0 are equal keys: keep them apart by their text.
        key = ("const", repr(node[1])) if node[0] == "const" else node
        if key not in self._ids:
            self._ids[key] = len(self.nodes)
            self.nodes.append(node)
            self.classes.append(node_class)
        return self._ids[key]

    def children(self, node: int) -> tuple[int, ...]:
        return () if self.nodes[node][0] in ("const", "param", "feature") else self.nodes[node][1:]

    def reachable(self, roots: Iterable[int]) -> list[int]:
        """All nodes under the roots, children before parents."""
        seen: set[int] = set()
        stack = list(roots)
        while stack:
            node = stack.pop()
            if node not in seen:
                seen.add(node)
                stack.extend(self.children(node))
        return sorted(seen)


def _log(x: ArrayLike) -> np.ndarray:
    """The machine's logarithm: finite at 0, so that 0^0 stays 1."""
    return np.where(x == 0, ZERO_LOG, np.log(np.where(x == 0, 1.0, x)))


ZERO_LOG = -1e38
"""What the engine takes for log(0): times 0 it is 0, times anything else exp makes it 0 or infinite."""

APPLY = {**FUNCTIONS, "log": _log}
"""What each operator of a graph computes: those of the grammar, and `log`."""


def add_expression(graph: Graph, expression: Expression) -> int:
    """The node of a whole expression."""
    if expression.symbol == "dot":
        name = dot_feature(expression.children[0].symbol, expression.children[1].symbol)
        if name == "1":
            return graph.const(1.0)
        if name == "2 wi.z^2 - 1":
            square = graph.emit("mul", graph.feature("wi.z"), graph.feature("wi.z"))
            return graph.emit("sub", graph.emit("mul", graph.const(2.0), square), graph.const(1.0))
        return graph.feature(name)
    if expression.children:
        return graph.emit(expression.symbol, *(add_expression(graph, c) for c in expression.children))
    kind = grammar.kind(expression.symbol)
    if kind == "parameter":
        return graph.param(expression.symbol)
    if kind == "component":
        return graph.feature("wi.z" if expression.symbol == "wr.z" else expression.symbol)
    return graph.const(grammar.value(expression.symbol))
