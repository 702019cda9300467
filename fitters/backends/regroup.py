"""Sums and products rearranged so that all that need not be computed per evaluation and cell is not.

A product of many factors becomes (scalar part) * (cell part) * (mixed part): the first is computed once per
evaluation, the second once per expression. Likewise for sums. A quotient by cell values becomes a product with
a reciprocal that is computed once, and a power of non-negative cell values the exponential of a hoisted
logarithm. Common factors are never cancelled: x / x at x = 0 must stay what it was.
"""

from collections import Counter

from fitters.expressions.lowered import CELL, CONSTANT, MIXED, SCALAR, Lowered
from fitters.expressions.operators import OPERATORS

_PRODUCTS = ("mul", "div", "neg")
_SUMS = ("add", "sub")

_NON_NEGATIVE_FEATURES = frozenset(("wi.z", "wo.z", "wh.z", "wi.wh"))


def regroup(source: Lowered, roots: list[int]) -> tuple[Lowered, list[int]]:
    """A new form that computes the same values for the roots, and their nodes there."""
    pass_ = _Regroup(source, roots)
    nodes = source.reachable(roots)
    opened = {child for node in nodes for child in source.children(node) if pass_.opens(node, child)}
    for node in nodes:
        # Children first, so that no recursion is as deep as the graph.
        if node not in opened:
            pass_.node(node)
    return pass_.target, [pass_.node(root) for root in roots]


class _Regroup:
    def __init__(self, source: Lowered, roots: list[int]) -> None:
        self.source = source
        self.target = Lowered()
        self.done: dict[int, int] = {}
        self.uses = Counter(roots)
        for node in source.reachable(roots):
            self.uses.update(source.children(node))

    def node(self, node: int) -> int:
        """The node of the new form that stands for one of the old."""
        if node not in self.done:
            self.done[node] = self._rebuild(node)
        return self.done[node]

    def _rebuild(self, node: int) -> int:
        operator, *rest = self.source.nodes[node]
        if operator == "const":
            return self.target.const(rest[0])
        if operator == "param":
            return self.target.param(rest[0])
        if operator == "feature":
            return self.target.feature(rest[0])
        if operator in _PRODUCTS:
            return self._product(node)
        if operator in _SUMS:
            return self._sum(node)
        if operator == "pow" and self._hoistable_power(node):
            base, exponent = (self.node(child) for child in rest)
            return self.target.emit("exp", self.target.emit("mul", exponent, self.target.emit("log", base)))
        return self.target.emit(operator, *(self.node(child) for child in rest))

    def _hoistable_power(self, node: int) -> bool:
        base, exponent = self.source.children(node)
        return (
            self.source.classes[base] == CELL
            and self.source.classes[exponent] in (SCALAR, MIXED)
            and non_negative(self.source, base)
        )

    def opens(self, parent: int, child: int) -> bool:
        """Whether rebuilding the parent takes the child apart."""
        operator, inner = self.source.nodes[parent][0], self.source.nodes[child][0]
        alike = inner in _PRODUCTS if operator in _PRODUCTS else operator in _SUMS and inner in (*_SUMS, "neg")
        return alike and self._may_open(child)

    def _may_open(self, node: int) -> bool:
        """Whether a nested sum or product may be taken apart: not where its value is wanted elsewhere too.

        A power is a chain of squares, each used twice: taken apart, pow(pow(wh.z, 16), 16) has 256 factors.
        """
        return self.uses[node] == 1

    def _product(self, root: int) -> int:
        above: list[int] = []
        below: list[int] = []
        sign = 1.0

        def collect(node: int, inverted: bool) -> None:
            nonlocal sign
            operator = self.source.nodes[node][0]
            if operator in _PRODUCTS and (node == root or self._may_open(node)):
                children = self.source.children(node)
                if operator == "neg":
                    sign = -sign
                collect(children[0], inverted)
                if operator != "neg":
                    collect(children[1], inverted != (operator == "div"))
            else:
                (below if inverted else above).append(self.node(node))

        collect(root, False)
        parts = [
            part
            for classes in ((CONSTANT, SCALAR), (CELL,))
            if (part := self._quotient(above, below, classes)) is not None
        ]
        if sign < 0:
            self._negate(parts, above)
        mixed_above = [node for node in above if self.target.classes[node] == MIXED]
        mixed_below = [node for node in below if self.target.classes[node] == MIXED]
        numerator = self._multiply([*parts, *mixed_above])
        if not mixed_below:
            return numerator if numerator is not None else self.target.const(sign)
        if numerator is None:
            numerator = self.target.const(1.0)
        return self.target.emit("div", numerator, self._multiply(mixed_below) or 0)

    def _negate(self, parts: list[int], above: list[int]) -> None:
        """Puts a minus sign where it costs least: on the scalar or cell part, else on a mixed factor."""
        if parts:
            parts[0] = self.target.emit("neg", parts[0])
            return
        mixed = [node for node in above if self.target.classes[node] == MIXED]
        if mixed:
            above.remove(mixed[0])
            parts.append(self.target.emit("neg", mixed[0]))
        else:
            parts.append(self.target.const(-1.0))

    def _quotient(self, above: list[int], below: list[int], classes: tuple[int, ...]) -> int | None:
        top = self._multiply([node for node in above if self.target.classes[node] in classes])
        bottom = self._multiply([node for node in below if self.target.classes[node] in classes])
        if bottom is None:
            return top
        return self.target.emit("div", self.target.const(1.0) if top is None else top, bottom)

    def _multiply(self, factors: list[int]) -> int | None:
        """A balanced product, so that as many equal pairs as possible are shared; None for no factor."""
        factors = sorted(factors, key=lambda node: (self.target.classes[node], node))
        while len(factors) > 1:
            pairs = zip(factors[::2], factors[1::2], strict=False)
            rest = factors[-1:] if len(factors) % 2 else []
            factors = [self.target.emit("mul", a, b) for a, b in pairs] + rest
        return factors[0] if factors else None

    def _sum(self, root: int) -> int:
        terms: list[tuple[bool, int]] = []

        def collect(node: int, minus: bool) -> None:
            operator = self.source.nodes[node][0]
            if operator in _SUMS and (node == root or self._may_open(node)):
                first, second = self.source.children(node)
                collect(first, minus)
                collect(second, minus != (operator == "sub"))
            elif operator == "neg" and self._may_open(node):
                collect(self.source.children(node)[0], not minus)
            else:
                terms.append((minus, self.node(node)))

        collect(root, False)
        groups = [
            [term for term in terms if self.target.classes[term[1]] in classes]
            for classes in ((CONSTANT, SCALAR), (CELL,), (MIXED,))
        ]
        total: int | None = None
        for group in groups:
            part = self._add_up(group)
            if part is not None:
                total = part if total is None else self.target.emit("add", total, part)
        assert total is not None
        return total

    def _add_up(self, terms: list[tuple[bool, int]]) -> int | None:
        total: int | None = None
        for minus, node in sorted(terms):
            if total is None:
                total = self.target.emit("neg", node) if minus else node
            else:
                total = self.target.emit("sub" if minus else "add", total, node)
        return total


def non_negative(form: Lowered, node: int) -> bool:
    """Whether a node's value is certainly not negative (it may be infinite or NaN)."""
    operator, *rest = form.nodes[node]
    if operator == "const":
        return rest[0] >= 0
    if operator == "feature":
        return rest[0] in _NON_NEGATIVE_FEATURES
    if operator == "param":
        return False
    if operator == "mul" and rest[0] == rest[1]:
        return True
    if operator == "sub":
        bound = form.value(rest[0])
        return bound is not None and _at_most(form, rest[1], bound)
    return OPERATORS[operator].non_negative(non_negative(form, child) for child in rest)


def _at_most(form: Lowered, node: int, bound: float) -> bool:
    """Whether a node's value is certainly not above the bound: features are cosines."""
    operator, *rest = form.nodes[node]
    if operator == "feature":
        return bound >= 1
    if operator == "mul" and bound >= 1:
        return all(non_negative(form, child) and _at_most(form, child, 1.0) for child in rest)
    return operator == "const" and rest[0] <= bound
