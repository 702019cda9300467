"""One form for expressions that compute the same: by it fits are remembered.

Sums and products are flattened and sorted, constants folded, neutral elements dropped, dot products reduced to the
features they are, and parameters numbered in the order in which they then occur. Only rounding tells the values of
the canonical form from those of the original. Nothing is cancelled or distributed: x / x at 0 is not a number in
both. Formulas that are equal for deeper reasons keep their forms apart, which costs a fit, not a mistake.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import copysign, isfinite
from typing import NamedTuple
from zlib import crc32

from fitters.expressions import grammar
from fitters.expressions.expression import Expression
from fitters.expressions.operators import OPERATORS
from fitters.expressions.simplification import folded, simplified


@dataclass(frozen=True)
class Canonical:
    """The canonical form in text form, and what each parameter of the original is called in it."""

    text: str
    names: Mapping[str, str] = field(hash=False)


_DOTS = {
    grammar.feature(first, second): f"dot({first}, {second})"
    for first, second in (("wi", "wo"), ("wi", "wh"), ("wo", "wr"), ("wh", "wr"), ("wi", "wr"))
}


class _Node(NamedTuple):
    """A node of a tree with `sum` and `product` of any number of children; `inverse` occurs in products only."""

    symbol: str
    children: tuple["_Node", ...] = ()
    value: float | None = None


_ONE = _Node("constant", value=1.0)
_MINUS_ZERO = _Node("neg", (_Node("constant", value=0.0),))
_INFINITE = _Node("inverse", (_Node("constant", value=0.0),))


def canonical(expression: Expression) -> Canonical:
    """The canonical form of an expression; that of a canonical form is itself."""
    flat = _flat(expression)
    contexts: dict[str, list[int]] = {}
    _collect_contexts(flat, 0, contexts)
    _, ordered = _ordered(flat, {name: ".".join(map(str, sorted(sums))) for name, sums in contexts.items()})
    names: dict[str, str] = {}
    return Canonical(_bare(_text(ordered, names), ordered), names)


def _flat(node: Expression) -> _Node:
    symbol = node.symbol
    if symbol == "dot":
        feature = grammar.feature(*(child.symbol for child in node.children))
        return _ONE if feature == "1" else _Node(feature)
    if not node.children:
        if grammar.kind(symbol) == "constant":
            return _Node("constant", value=grammar.value(symbol))
        return _Node(grammar.feature(symbol))
    operator, children = OPERATORS[symbol], tuple(_flat(child) for child in node.children)
    constant = folded(_FORM, operator, children)
    if constant is not None:
        return constant
    if symbol == "neg":
        return _negated(children[0])
    if symbol in ("add", "sub"):
        return _sum(children[0], children[1] if symbol == "add" else _negated(children[1]))
    if symbol in ("mul", "div"):
        return _product(children[0], children[1], inverse=symbol == "div")
    return simplified(_FORM, operator, children) or _Node(symbol, children)


class _Form:
    """How the rules of simplification see these nodes; sums and products are not left to them."""

    def value(self, node: _Node) -> float | None:
        return node.value

    def constant(self, value: float) -> _Node | None:
        # -0.0 is left alone: its reciprocal has the other sign.
        fits = isfinite(value) and (value or copysign(1.0, value) > 0)
        return _Node("constant", value=value) if fits else None

    def operands(self, node: _Node, operator: str) -> tuple[_Node, ...] | None:
        return node.children if node.symbol == operator else None

    def make(self, operator: str, *operands: _Node) -> _Node:
        return _Node(operator, operands)


_FORM = _Form()


def _unordered(symbol: str) -> bool:
    return symbol in ("sum", "product") or (symbol in OPERATORS and OPERATORS[symbol].commutative)


def _negated(node: _Node) -> _Node:
    if node.value:
        return _Node("constant", value=-node.value)
    if node.symbol == "neg":
        return node.children[0]
    if node.symbol == "sum":
        return _Node("sum", tuple(_negated(child) for child in node.children))
    return _Node("neg", (node,))


def _sum(*parts: _Node) -> _Node:
    """A flat sum; at most one constant in it, and not 0."""
    terms = [term for part in parts for term in (part.children if part.symbol == "sum" else (part,))]
    rest = [term for term in terms if term.value is None and term != _MINUS_ZERO]
    constant = sum(term.value for term in terms if term.value is not None)
    if constant != 0.0 or not rest:
        rest.append(_Node("constant", value=constant))
    return rest[0] if len(rest) == 1 else _Node("sum", tuple(rest))


def _product(first: _Node, second: _Node, *, inverse: bool) -> _Node:
    """A flat product, its sign outside; at most one constant in it, and not 1."""
    negative, factors = False, []
    for part, inverted in ((first, False), (second, inverse)):
        if part.symbol == "neg":
            negative, part = not negative, part.children[0]
        for factor in part.children if part.symbol == "product" else (part,):
            factors.append(_inverse(factor) if inverted else factor)
    constant, *large = _multiplied([factor.value for factor in factors if factor.value is not None])
    rest = [_Node("constant", value=value) for value in large]
    for factor in factors:
        if factor.value is None and (factor != _INFINITE or factor not in rest):
            rest.append(factor)
    negative = negative != (constant < 0)
    if abs(constant) != 1.0 or not rest:
        rest.append(_Node("constant", value=abs(constant)))
    product = rest[0] if len(rest) == 1 and rest[0].symbol != "inverse" else _Node("product", tuple(rest))
    return _negated(product) if negative else product


def _multiplied(values: list[float]) -> list[float]:
    """Constants multiplied with one another as long as that is finite, the smallest first: at least one is left.

    The two smallest have the smallest product: where that is infinite, so is any other, in whatever order.
    """
    left = sorted([1.0, *values], key=abs)
    while len(left) > 1 and isfinite(left[0] * left[1]):
        left = sorted([left[0] * left[1], *left[2:]], key=abs)
    return left


def _inverse(factor: _Node) -> _Node:
    if factor.symbol == "inverse":
        return factor.children[0]
    if factor.value is not None and factor.value != 0.0 and isfinite(1.0 / factor.value):
        return _Node("constant", value=1.0 / factor.value)
    return _Node("inverse", (factor,))


def _collect_contexts(node: _Node, path: int, contexts: dict[str, list[int]]) -> None:
    """Where each parameter occurs, as check sums of the symbols above it, which tell parameters apart."""
    if not node.children:
        if grammar.is_parameter(node.symbol):
            contexts.setdefault(node.symbol, []).append(path)
        return
    for place, child in enumerate(node.children):
        position = "" if _unordered(node.symbol) else str(place)
        _collect_contexts(child, crc32(f"{node.symbol}{position}".encode(), path), contexts)


def _ordered(node: _Node, signatures: Mapping[str, str]) -> tuple[str, _Node]:
    """A node with its unordered children sorted, and the key by which it is sorted itself."""
    if not node.children:
        text = repr(node.value) if node.value is not None else f"p{signatures.get(node.symbol, node.symbol)}"
        return text, node
    pairs = [_ordered(child, signatures) for child in node.children]
    if _unordered(node.symbol):
        pairs.sort(key=lambda pair: pair[0])
    key = f"{node.symbol}({','.join(key for key, _ in pairs)})"
    return key, _Node(node.symbol, tuple(child for _, child in pairs))


def _text(node: _Node, names: dict[str, str]) -> str:
    """Text of a node, a sum or product in parentheses; parameters get their numbers as they come."""
    if node.value is not None:
        return f"{'-' if node.value < 0 else ''}{grammar.constant(abs(node.value))}"
    if not node.children:
        if grammar.is_parameter(node.symbol):
            return names.setdefault(node.symbol, f"p{len(names)}")
        return _DOTS.get(node.symbol, node.symbol)
    if node.symbol == "neg":
        return f"-{_text(node.children[0], names)}"
    if node.symbol == "sum":
        terms = [_text(child, names) for child in node.children]
        return f"({' + '.join(terms).replace('+ -', '- ')})"
    if node.symbol == "product":
        plain = [_text(child, names) for child in node.children if child.symbol != "inverse"]
        under = [_text(child.children[0], names) for child in node.children if child.symbol == "inverse"]
        return f"({' / '.join([' * '.join(plain or ['1']), *under])})"
    return f"{node.symbol}({', '.join(_bare(_text(child, names), child) for child in node.children)})"


def _bare(text: str, node: _Node) -> str:
    """The text of a node without the parentheses around a whole sum or product."""
    return text[1:-1] if node.symbol in ("sum", "product") else text
