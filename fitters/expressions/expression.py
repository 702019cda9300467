"""Expressions: immutable trees over the grammar."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

from fitters.errors import FittersError
from fitters.expressions import grammar

MAX_DEPTH = 200
"""No tree is deeper: what walks a tree may recurse."""


@dataclass(frozen=True, slots=True, repr=False, init=False)
class Expression:
    """A node and its children. Equal trees are equal and hash alike.

    `nodes` is the size: every operator, constant, parameter, component and vector counts one.
    Raises `FittersError` where the children do not fit the symbol.
    """

    symbol: str
    children: tuple["Expression", ...]
    nodes: int = field(compare=False)
    depth: int = field(compare=False)
    _hash: int = field(compare=False)

    def __init__(self, symbol: str, children: tuple["Expression", ...] = ()) -> None:
        kind = grammar.kind(symbol)
        if not kind:
            raise FittersError(f"{symbol!r} is no symbol of the grammar")
        if len(children) != grammar.arity(symbol):
            raise FittersError(f"{symbol} takes {grammar.arity(symbol)} arguments, {len(children)} given")
        nodes, depth, own = 1, 0, hash(symbol)
        for child in children:
            if (child.symbol in grammar.VECTORS) != (kind == "dot"):
                wanted = "vectors" if kind == "dot" else "scalars"
                raise FittersError(f"{symbol} takes {wanted}, {child.symbol} given")
            nodes += child.nodes
            depth = max(depth, child.depth)
            own = hash((own, child._hash))
        if depth >= MAX_DEPTH:
            raise FittersError(f"an expression may be at most {MAX_DEPTH} levels deep")
        for assign, value in zip(_ASSIGN, (symbol, children, nodes, depth + 1, own), strict=True):
            assign(self, value)

    def __hash__(self) -> int:
        return self._hash

    def __reduce__(self) -> tuple[type["Expression"], tuple[str, tuple["Expression", ...]]]:
        # Hashes of strings differ between processes: make them again.
        return Expression, (self.symbol, self.children)

    def __repr__(self) -> str:
        return f"{self.symbol}({', '.join(map(repr, self.children))})" if self.children else self.symbol

    @property
    def is_vector(self) -> bool:
        return self.symbol in grammar.VECTORS

    def walk(self) -> Iterator["Expression"]:
        """Every node of the tree, parents before children, left to right."""
        stack = [self]
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.children))

    @property
    def parameters(self) -> tuple[str, ...]:
        """The parameters that occur, by number: `("p0", "p2")`."""
        names = {node.symbol for node in self.walk() if grammar.is_parameter(node.symbol)}
        return tuple(sorted(names, key=lambda symbol: int(symbol[1:])))


# What `object.__setattr__` does for a frozen object, at half the time: trees are made by the million.
_ASSIGN = [getattr(Expression, field.name).__set__ for field in fields(Expression)]
