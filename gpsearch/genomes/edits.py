"""The four edits of the genBRDF paper, section 3.3, and what they do to an expression.

Addresses. An edit must keep its meaning after crossover has moved it behind other edits. An index or a path would
not: an earlier edit shifts it onto some other node. So every node has a label for life. The nodes of a starting
expression are labelled by their place in it, and nodes that an edit brings by the edit's own label and their place
in what it brings: `3f2a90c1d4e5.7`. A label names the same node wherever swaps have carried it, and whatever has
become of the nodes around it. An edit whose label no longer (or not yet) exists does nothing; it stays in the
genome and acts again where crossover brings the missing node back.
"""

from dataclasses import dataclass, field
from functools import lru_cache

from fitters.expressions import Expression, grammar, parse
from fitters.expressions.expression import MAX_DEPTH


@dataclass(frozen=True, slots=True)
class Swap:
    """Two nodes change places, neither inside the other."""

    first: str
    second: str


@dataclass(frozen=True, slots=True)
class Insert:
    """A subexpression of the codebank, in text form, takes the place of the node `at`. `label` names its nodes."""

    at: str
    subexpression: str
    label: str


@dataclass(frozen=True, slots=True)
class Replace:
    """The node `at` gets another symbol of its own sort and keeps its children and its label."""

    at: str
    symbol: str


@dataclass(frozen=True, slots=True)
class Delete:
    """The constant 1 takes the place of the node `at`. `label` names it."""

    at: str
    label: str


parsed = lru_cache(maxsize=4096)(parse)
"""`parse`, for the few texts that come again and again: starts and the codebank."""

Edit = Swap | Insert | Replace | Delete


def sort(symbol: str) -> str:
    """What may replace what: `unary`, `binary`, `dot`, `vector`, or `scalar` for the leaves that are numbers."""
    kind = grammar.kind(symbol)
    return "scalar" if kind in ("parameter", "constant", "component") else kind


@dataclass
class Draft:
    """An expression under edit: nodes by label. The one mutable thing here; it does not leave `reify`."""

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
        """The expression under a label, the whole by default."""
        label = self.root if label is None else label
        return Expression(self.symbols[label], tuple(self.expression(child) for child in self.children[label]))

    def apply(self, edit: Edit) -> bool:
        """Applies an edit where it can be; whether it did anything."""
        match edit:
            case Swap(first, second):
                return self._swap(first, second)
            case Insert(at, subexpression, label):
                return self._put(at, parsed(subexpression), label)
            case Delete(at, label):
                return self._put(at, Expression("1"), label)
            case Replace(at, symbol):
                if at not in self.symbols or sort(self.symbols[at]) != sort(symbol):
                    return False
                self.symbols[at] = symbol
                return True

    def is_number(self, label: str) -> bool:
        """Whether the label exists and its node has a value, as a vector has not."""
        return label in self.symbols and self.symbols[label] not in grammar.VECTORS

    def inside(self, label: str, ancestor: str) -> bool:
        """Whether a node lies in the subtree of another, or is it."""
        at: str | None = label
        while at is not None:
            if at == ancestor:
                return True
            at = self.parents[at]
        return False

    def level(self, label: str) -> int:
        """How many nodes lie above the one of this label."""
        count, at = 0, self.parents[label]
        while at is not None:
            count, at = count + 1, self.parents[at]
        return count

    def fits(self, max_nodes: int) -> bool:
        """Whether this is an expression of the language of at most so many nodes."""
        if len(self.symbols) > max_nodes:
            return False
        depth, layer = 0, [self.root]
        while layer:
            depth, layer = depth + 1, [child for label in layer for child in self.children[label]]
        return depth <= MAX_DEPTH

    def _grow(self, expression: Expression, label: str, parent: str | None) -> str:
        """Adds the nodes of an expression, labelled in preorder; returns the label of its root."""
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
        # Two children of one parent: find both places before writing either.
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
