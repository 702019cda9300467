"""The one simplifier: rules that follow from the facts in the table of operators, for every form of expressions.

`simplified` keeps every value to the last bit, NaN and infinity too; only the sign of a zero may change.
`shortened` also keeps values, except for rounding and except for cells where what goes was not finite.
"""

from collections.abc import Sequence
from math import copysign, isfinite
from typing import Protocol, TypeVar

import numpy as np

from fitters.expressions import grammar
from fitters.expressions.expression import Expression
from fitters.expressions.operators import OPERATORS, Operator

N = TypeVar("N")


class Form(Protocol[N]):
    """How the rules look into a form of expressions and add to it: a tree, or nodes of the lowered form."""

    def value(self, node: N) -> float | None:
        """The number that a node is; None for what is no constant."""

    def constant(self, value: float) -> N | None:
        """A constant; None where this form has none of that value."""

    def operands(self, node: N, operator: str) -> Sequence[N] | None:
        """The operands of a node of that operator; None for any other node."""

    def make(self, operator: str, *operands: N) -> N:
        """The node of an operation."""


def folded(form: Form[N], operator: Operator, operands: Sequence[N]) -> N | None:
    """The constant that an operator makes of constants, where the form has it."""
    values = []
    for operand in operands:
        value = form.value(operand)
        if value is None:
            return None
        values.append(np.float64(value))
    with np.errstate(all="ignore"):
        return form.constant(float(operator.meaning(*values)))


def simplified(form: Form[N], operator: Operator, operands: Sequence[N]) -> N | None:
    """A simpler node of the same value to the last bit; None where there is none."""
    first, last = operands[0], operands[-1]
    if operator.undoes_itself and (inner := form.operands(first, operator.name)):
        return inner[0]
    if operator.neutral is not None:
        if form.value(last) == operator.neutral:
            return first
        if operator.commutative and form.value(first) == operator.neutral:
            return last
    if operator.opposite:
        if negated := form.operands(last, "neg"):
            return form.make(operator.opposite, first, negated[0])
        if operator.commutative and (negated := form.operands(first, "neg")):
            return form.make(operator.opposite, last, negated[0])
    return None


def shortened(form: Form[N], operator: Operator, operands: Sequence[N]) -> N | None:
    """A simpler node of the same value, except for rounding and what was not finite; None where there is none."""
    first, last = operands[0], operands[-1]
    for place, value, result in operator.absorbing:
        if form.value(operands[place]) == value:
            return form.constant(result)
    if operator.idempotent and first == last:
        return first
    if operator.opposite and not operator.commutative and form.value(first) == operator.neutral:
        # 0 - b = -b
        simpler = simplified(form, OPERATORS["neg"], (last,))
        return form.make("neg", last) if simpler is None else simpler
    if operator.inverse:
        for factor, quotient in ((first, last), (last, first)):
            inner = form.operands(quotient, operator.inverse)
            if inner and form.value(inner[0]) == operator.neutral:
                return form.make(operator.inverse, factor, inner[1])
    return simplified(form, operator, operands)


def tidy(node: Expression) -> Expression:
    """The same formula with fewer nodes, or as many where there is nothing to shorten.

    Everything else keeps its place, so that the formula can still be recognised.
    """
    if node.symbol == "dot":
        feature = grammar.feature(*(child.symbol for child in node.children))
        return Expression(feature) if grammar.kind(feature) else node
    if not node.children:
        return node
    operator, children = OPERATORS[node.symbol], tuple(tidy(child) for child in node.children)
    shorter = folded(_TREE, operator, children) or shortened(_TREE, operator, children)
    return shorter or Expression(node.symbol, children)


class _Tree:
    """Trees of the grammar, whose constants are finite and not negative."""

    def value(self, node: Expression) -> float | None:
        return grammar.value(node.symbol) if grammar.kind(node.symbol) == "constant" else None

    def constant(self, value: float) -> Expression | None:
        fits = isfinite(value) and copysign(1.0, value) > 0
        return Expression(grammar.constant(value)) if fits else None

    def operands(self, node: Expression, operator: str) -> Sequence[Expression] | None:
        return node.children if node.symbol == operator else None

    def make(self, operator: str, *operands: Expression) -> Expression:
        return Expression(operator, operands)


_TREE = _Tree()
