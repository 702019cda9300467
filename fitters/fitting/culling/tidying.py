"""Expressions without what does nothing in them: neutral elements, double signs, constants that can be worked out.

The values stay the same but for rounding, and but for cells where what goes was not finite. Everything else keeps
its place, so that a formula can be told again after it.
"""

from collections.abc import Callable
from math import copysign, isfinite

import numpy as np

from fitters.expressions import Expression, grammar
from fitters.expressions.evaluation import FUNCTIONS, dot_feature

ZERO, ONE = Expression("0"), Expression("1")

_DOTS = {name: Expression(name) for name in ("1", *grammar.COMPONENTS)}
"""Dot products that are one node, too."""


def tidy(node: Expression) -> Expression:
    """The same formula with fewer nodes, or as many where there is nothing to tidy."""
    if node.symbol == "dot":
        return _DOTS.get(dot_feature(node.children[0].symbol, node.children[1].symbol), node)
    if not node.children:
        return node
    children = tuple(tidy(child) for child in node.children)
    simpler = _worked_out(node.symbol, children) or _RULES.get(node.symbol, _none)(*children)
    return simpler or Expression(node.symbol, children)


def replaced(expression: Expression, path: tuple[int, ...], by: Expression) -> Expression:
    """The expression with the node at a path (the number of a child at every level) replaced."""
    if not path:
        return by
    first, *rest = path
    children = list(expression.children)
    children[first] = replaced(children[first], tuple(rest), by)
    return Expression(expression.symbol, tuple(children))


def substituted(expression: Expression, leaves: dict[str, Expression]) -> Expression:
    """The expression with leaves replaced wherever they occur, by their symbols."""
    if not expression.children:
        return leaves.get(expression.symbol, expression)
    return Expression(expression.symbol, tuple(substituted(child, leaves) for child in expression.children))


def _worked_out(symbol: str, children: tuple[Expression, ...]) -> Expression | None:
    """The constant that an operator makes of constants, where the grammar has it: finite and not negative."""
    if not all(grammar.kind(child.symbol) == "constant" for child in children):
        return None
    with np.errstate(all="ignore"):
        value = float(FUNCTIONS[symbol](*(np.float64(grammar.value(child.symbol)) for child in children)))
    return Expression(grammar.constant(value)) if isfinite(value) and copysign(1.0, value) > 0 else None


def _none(*children: Expression) -> None:
    return None


def _negated(a: Expression) -> Expression | None:
    return a.children[0] if a.symbol == "neg" else None


def _sum(a: Expression, b: Expression) -> Expression | None:
    if b == ZERO:
        return a
    if a == ZERO:
        return b
    if b.symbol == "neg":
        return Expression("sub", (a, b.children[0]))
    return Expression("sub", (b, a.children[0])) if a.symbol == "neg" else None


def _difference(a: Expression, b: Expression) -> Expression | None:
    if b == ZERO:
        return a
    if a == ZERO:
        return _negated(b) or Expression("neg", (b,))
    return Expression("add", (a, b.children[0])) if b.symbol == "neg" else None


def _product(a: Expression, b: Expression) -> Expression | None:
    if ZERO in (a, b):
        return ZERO
    if a == ONE or b == ONE:
        return b if a == ONE else a
    if b.symbol == "div" and b.children[0] == ONE:
        return Expression("div", (a, b.children[1]))
    return Expression("div", (b, a.children[1])) if a.symbol == "div" and a.children[0] == ONE else None


def _quotient(a: Expression, b: Expression) -> Expression | None:
    if b == ONE:
        return a
    return ZERO if a == ZERO else None


def _power(a: Expression, b: Expression) -> Expression | None:
    if b == ONE:
        return a
    return ONE if b == ZERO or a == ONE else None


def _extreme(a: Expression, b: Expression) -> Expression | None:
    return a if a == b else None


_RULES: dict[str, Callable[..., Expression | None]] = {
    "neg": _negated,
    "add": _sum,
    "sub": _difference,
    "mul": _product,
    "div": _quotient,
    "pow": _power,
    "max": _extreme,
    "min": _extreme,
}
