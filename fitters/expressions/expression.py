"""Expressions: immutable trees over the grammar."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from fitters.errors import FittersError
from fitters.expressions import grammar

MAX_DEPTH = 200
"""No tree is deeper: what walks a tree may recurse."""


@dataclass(frozen=True, slots=True, repr=False)
class Expression:
    """A node and its children. Equal trees are equal and hash alike.

    `nodes` is the size: every operator, constant, parameter, component and vector counts one.
    Raises `FittersError` where the children do not fit the symbol.
    """

    symbol: str
    children: tuple["Expression", ...] = ()
    nodes: int = field(init=False, compare=False)
    depth: int = field(init=False, compare=False)
    _hash: int = field(init=False, compare=False)

    def __post_init__(self) -> None:
        kind = grammar.kind(self.symbol)
        if not kind:
            raise FittersError(f"{self.symbol!r} is no symbol of the grammar")
        if len(self.children) != grammar.arity(self.symbol):
            raise FittersError(
                f"{self.symbol} takes {grammar.arity(self.symbol)} arguments, {len(self.children)} given"
            )
        for child in self.children:
            if child.is_vector != (kind == "dot"):
                wanted = "vectors" if kind == "dot" else "scalars"
                raise FittersError(f"{self.symbol} takes {wanted}, {child.symbol} given")
        depth = 1 + max((child.depth for child in self.children), default=0)
        if depth > MAX_DEPTH:
            raise FittersError(f"an expression may be at most {MAX_DEPTH} levels deep")
        object.__setattr__(self, "nodes", 1 + sum(child.nodes for child in self.children))
        object.__setattr__(self, "depth", depth)
        object.__setattr__(self, "_hash", hash((self.symbol, *(child._hash for child in self.children))))

    def __hash__(self) -> int:
        return self._hash

    def __reduce__(self) -> tuple[type["Expression"], tuple[str, tuple["Expression", ...]]]:
        # Hashes of strings differ between processes: make them anew.
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
        found = {node.symbol for node in self.walk() if grammar.is_parameter(node.symbol)}
        return tuple(sorted(found, key=lambda symbol: int(symbol[1:])))
