"""The one lowered form of expressions: nodes in single-assignment form, each operation once, children first.

Its leaves are constants, parameters and features of two directions: it has neither vectors nor dot products. Every
backend reads it, by `Walk`. Every node has a class, which says when it must be computed:
    CONSTANT  never, it is a number
    SCALAR    once per evaluation: parameters and constants only
    CELL      once per expression: features of the cells and constants only
    MIXED     per evaluation and cell
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from functools import lru_cache
from typing import Generic, TypeVar

import numpy as np

from fitters.expressions import grammar
from fitters.expressions.expression import Expression
from fitters.expressions.operators import OPERATORS
from fitters.expressions.simplification import folded, simplified

CONSTANT, SCALAR, CELL, MIXED = range(4)

Node = tuple  # ("const", value), ("param", name), ("feature", name) or (operator, id[, id])

LEAVES = ("const", "param", "feature")
_LARGEST_POWER = 16
"""Whole powers up to this become products."""

T = TypeVar("T")


class Lowered:
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

    def operation(self, operator: str, *children: int) -> int:
        """The node of an operation as it is written."""
        kinds = {self.classes[child] for child in children} - {CONSTANT}
        return self._add((operator, *children), MIXED if len(kinds) > 1 else kinds.pop() if kinds else CELL)

    def emit(self, operator: str, *children: int) -> int:
        """The node of an operation: folded where it is constant, simplified where that keeps every value."""
        entry = OPERATORS[operator]
        simpler = folded(self, entry, children)
        if simpler is None:
            simpler = simplified(self, entry, children)
        if simpler is None and operator == "pow":
            simpler = self._power(children[0], self.value(children[1]))
        if simpler is not None:
            return simpler
        if entry.commutative and children[0] > children[1]:
            children = children[::-1]
        return self.operation(operator, *children)

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
        return () if self.nodes[node][0] in LEAVES else self.nodes[node][1:]

    def reachable(self, roots: Iterable[int], given: Collection[int] = ()) -> list[int]:
        """All nodes under the roots, children before parents; none that is given, nor what only it needs."""
        seen: set[int] = set()
        stack = list(roots)
        while stack:
            node = stack.pop()
            if node not in seen and node not in given:
                seen.add(node)
                stack.extend(self.children(node))
        return sorted(seen)

    def value(self, node: int) -> float | None:
        """The number that a constant node is, None for any other."""
        return self.nodes[node][1] if self.classes[node] == CONSTANT else None

    # With `value` and `const`, what the rules of simplification ask of a form.

    def constant(self, value: float) -> int:
        return self.const(value)

    def operands(self, node: int, operator: str) -> tuple[int, ...] | None:
        return self.nodes[node][1:] if self.nodes[node][0] == operator else None

    def make(self, operator: str, *operands: int) -> int:
        return self.emit(operator, *operands)


def add_expression(form: Lowered, expression: Expression, *, as_written: bool = False) -> int:
    """The node of a whole expression, simplified unless `as_written`."""
    operation = form.operation if as_written else form.emit

    def add(node: Expression) -> int:
        if node.symbol == "dot":
            return feature(grammar.feature(*(child.symbol for child in node.children)))
        if node.children:
            return operation(node.symbol, *map(add, node.children))
        kind = grammar.kind(node.symbol)
        if kind == "parameter":
            return form.param(node.symbol)
        if kind == "component":
            return feature(grammar.feature(node.symbol))
        return form.const(grammar.value(node.symbol))

    def feature(name: str) -> int:
        if name == "1":
            return form.const(1.0)
        if name == grammar.MIRRORED:
            square = operation("mul", form.feature("wi.z"), form.feature("wi.z"))
            return operation("sub", operation("mul", form.const(2.0), square), form.const(1.0))
        return form.feature(name)

    return add(expression)


@lru_cache(maxsize=256)
def lowered(expression: Expression) -> tuple[Lowered, int]:
    """The lowered form of an expression as it is written, and its root: nothing folded, nothing simplified."""
    form = Lowered()
    return form, add_expression(form, expression, as_written=True)


class Walk(Generic[T]):
    """The nodes under some roots in the order in which they are computed; every backend is a walk.

    given: nodes whose values the caller has; what only they need is not computed. A value is dropped after the
    last node that reads it.
    """

    def __init__(self, form: Lowered, roots: Iterable[int], given: Collection[int] = ()) -> None:
        self.roots = tuple(roots)
        order = form.reachable(self.roots, given)
        last = {child: node for node in order for child in form.children(node)}
        kept = {*self.roots, *given}
        dropped: dict[int, list[int]] = {}
        for child, node in last.items():
            if child not in kept:
                dropped.setdefault(node, []).append(child)
        self._steps = [(node, *_split(form.nodes[node]), dropped.get(node, ())) for node in order]

    def run(
        self,
        leaf: Callable[[str, float | str], T],
        operation: Callable[..., T],
        given: Mapping[int, T] | None = None,
    ) -> list[T]:
        """The values of the roots, from `leaf(kind, name or number)` and `operation(operator, *operands)`."""
        values = dict(given or {})
        for node, symbol, label, children, dropped in self._steps:
            if children:
                values[node] = operation(symbol, *[values[child] for child in children])
            else:
                values[node] = leaf(symbol, label)
            for child in dropped:
                del values[child]
        return [values[root] for root in self.roots]


def _split(node: Node) -> tuple[str, float | str, tuple[int, ...]]:
    """The symbol, the name or number of a leaf, and the children of an operation."""
    return (node[0], node[1], ()) if node[0] in LEAVES else (node[0], "", node[1:])
