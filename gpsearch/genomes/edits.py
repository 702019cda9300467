"""The four edits of the genBRDF paper, section 3.3, and what they do to an expression.

Addresses. An edit must keep its meaning after crossover has put it behind other edits. An index or a path cannot
do that: after an earlier edit it would lead to another node. So every node has a permanent label. A node of the
starting expression has the expression's label and its index in preorder; a node that an edit adds has the edit's
label and its index in the added subexpression: `3f2a90c1d4e5.7`. A label names the same node after swaps have
moved it and edits have changed the nodes around it. An edit whose node does not exist has no effect; it stays in
the genome, and has an effect again after crossover has restored the node.
"""

from dataclasses import dataclass, field
from functools import lru_cache

from fitters.expressions import Expression, grammar, parse
from fitters.expressions.expression import MAX_DEPTH


@dataclass(frozen=True, slots=True)
class Swap:
    """Two nodes change places. Neither may be inside the other."""

    first: str
    second: str


@dataclass(frozen=True, slots=True)
class Insert:
    """A subexpression of the codebank, in text form, replaces the node `at`. `label` is the label of its nodes."""

    at: str
    subexpression: str
    label: str


@dataclass(frozen=True, slots=True)
class Replace:
    """The node `at` gets another symbol of the same kind, and keeps its children and its label."""

    at: str
    symbol: str


@dataclass(frozen=True, slots=True)
class Delete:
    """The constant 1 replaces the node `at`. `label` is the label of the constant."""

    at: str
    label: str


parsed = lru_cache(maxsize=4096)(parse)
"""`parse` with a cache, for starting expressions and the codebank."""

Edit = Swap | Insert | Replace | Delete


def replacement_kind(symbol: str) -> str:
    """What may replace each other: `unary`, `binary`, `dot`, `vector`, or `scalar` for leaves with a value."""
    kind = grammar.kind(symbol)
    return "scalar" if kind in ("parameter", "constant", "component") else kind


@dataclass
class Draft:
    """An expression while it is edited, as nodes by label; mutable."""

    root: str = ""
    symbols: dict[str, str] = field(default_factory=dict)
    children: dict[str, list[str]] = field(default_factory=dict)
    parents: dict[str, str | None] = field(default_factory=dict)

    @classmethod
    def of(cls, expression: Expression, label: str) -> "Draft":
        draft = cls()
        draft.root = draft._grow(expression, label, None)
        return draft

    def expression(self, label: str | None = None) -> Expression:
        """The expression below a label, by default the whole."""
        label = self.root if label is None else label
        return Expression(self.symbols[label], tuple(self.expression(child) for child in self.children[label]))

    def apply(self, edit: Edit) -> bool:
        """Applies an edit. Returns False where it has no effect."""
        match edit:
            case Swap(first, second):
                return self._swap(first, second)
            case Insert(at, subexpression, label):
                return self._put(at, parsed(subexpression), label)
            case Delete(at, label):
                return self._put(at, Expression("1"), label)
            case Replace(at, symbol):
                if at not in self.symbols or replacement_kind(self.symbols[at]) != replacement_kind(symbol):
                    return False
                self.symbols[at] = symbol
                return True

    def is_number(self, label: str) -> bool:
        """Whether the label exists and its node is no vector."""
        return label in self.symbols and self.symbols[label] not in grammar.VECTORS

    def inside(self, label: str, ancestor: str) -> bool:
        """Whether a node is `ancestor` or lies below it."""
        at: str | None = label
        while at is not None:
            if at == ancestor:
                return True
            at = self.parents[at]
        return False

    def level(self, label: str) -> int:
        """The number of nodes above a node."""
        count, at = 0, self.parents[label]
        while at is not None:
            count, at = count + 1, self.parents[at]
        return count

    def within_limits(self, max_nodes: int) -> bool:
        """Whether it has at most `max_nodes` nodes and `MAX_DEPTH` levels."""
        if len(self.symbols) > max_nodes:
            return False
        depth, layer = 0, [self.root]
        while layer:
            depth, layer = depth + 1, [child for label in layer for child in self.children[label]]
        return depth <= MAX_DEPTH

    def _grow(self, expression: Expression, label: str, parent: str | None) -> str:
        """Adds the nodes of an expression with labels in preorder. Returns the label of its root."""
        count = 0

        def add(node: Expression, parent: str | None) -> str:
            nonlocal count
            name = f"{label}.{count}"
            count += 1
            self.symbols[name], self.parents[name] = node.symbol, parent
            self.children[name] = []
            self.children[name] = [add(child, name) for child in node.children]
            return name

        return add(expression, parent)

    def _swap(self, first: str, second: str) -> bool:
        if not (self.is_number(first) and self.is_number(second)):
            return False
        if self.inside(first, second) or self.inside(second, first):
            return False
        # Both may be children of one parent: find both places before changing either.
        places = [(self.parents[label], self._place(label)) for label in (first, second)]
        for (parent, place), label in zip(places, (second, first), strict=True):
            self._attach(label, parent, place)
        return True

    def _put(self, at: str, expression: Expression, label: str) -> bool:
        if not self.is_number(at) or f"{label}.0" in self.symbols:
            return False
        parent, place = self.parents[at], self._place(at)
        self._forget(at)
        self._attach(self._grow(expression, label, parent), parent, place)
        return True

    def _place(self, label: str) -> int:
        parent = self.parents[label]
        return 0 if parent is None else self.children[parent].index(label)

    def _attach(self, label: str, parent: str | None, place: int) -> None:
        self.parents[label] = parent
        if parent is None:
            self.root = label
        else:
            self.children[parent][place] = label

    def _forget(self, label: str) -> None:
        # No recursion: between two edits a draft may be deeper than any expression.
        outdated = [label]
        while outdated:
            label = outdated.pop()
            outdated += self.children.pop(label)
            del self.symbols[label], self.parents[label]
