"""The single steps by which a formula can become a smaller one, whatever that does to its error."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isfinite

from fitters.expressions import Expression, grammar
from fitters.expressions.canonical import canonical
from fitters.expressions.operators import OPERATORS
from fitters.expressions.simplification import tidy

ZERO, ONE = Expression("0"), Expression("1")

DELETED, SIMPLIFIED, DROPPED, SNAPPED = "deleted", "simplified", "parameter dropped", "constant snapped"

ROUND = ("0.5", "1", "2", "pi", "4")
"""What a parameter is tried at beside 0 and rounded values of its own."""

COSINES = tuple(Expression(symbol) for symbol in ("wi.z", "wo.z", "wh.z"))


@dataclass(frozen=True)
class Reduction:
    """A step: `before` becomes `after`, wherever that is, and the formula `whole`."""

    what: str
    before: Expression
    after: Expression
    whole: Expression

    @property
    def key(self) -> tuple[Expression, Expression]:
        """What two steps of different formulas have in common."""
        return self.before, self.after


def complexity(expression: Expression) -> tuple[int, int, int]:
    """What every reduction lowers: nodes and parameters together, then nodes, then the digits of all constants."""
    digits = sum(len(node.symbol) for node in expression.walk() if grammar.is_constant(node.symbol))
    return expression.nodes + len(expression.parameters), expression.nodes, digits


def reductions(expression: Expression, typical: Mapping[str, float], spare: str | None) -> list[Reduction]:
    """Every reduction of an expression, of those that make the same formula the first.

    typical: a value for each of its parameters, at which it may be held
    spare:   a parameter that may take the place of a subexpression; None where there is none left
    """
    least = complexity(expression)
    different: dict[Expression, Reduction] = {}
    for what, before, after, whole in _every(expression, typical, spare):
        whole = tidy(whole)
        if whole not in different and complexity(whole) < least:
            different[whole] = Reduction(what, before, after, whole)
    by_form: dict[str, Reduction] = {}
    for reduction in different.values():
        by_form.setdefault(canonical(reduction.whole).text, reduction)
    return list(by_form.values())


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


_Step = tuple[str, Expression, Expression, Expression]


def _every(expression: Expression, typical: Mapping[str, float], spare: str | None) -> Iterator[_Step]:
    tidied = tidy(expression)
    yield SIMPLIFIED, *_smallest_difference(expression, tidied), tidied
    for name in expression.parameters:
        parameter = Expression(name)
        for after in _in_place_of(name, expression, typical):
            yield DROPPED, parameter, after, substituted(expression, {name: after})
    for path, node in _numbers(expression, ()):
        for what, after in _replacements(node):
            yield what, node, after, replaced(expression, path, after)
    for path, node in _numbers(expression, ()):
        if spare is not None and node.nodes > 1:
            yield SIMPLIFIED, node, Expression(spare), replaced(expression, path, Expression(spare))


def _smallest_difference(one: Expression, other: Expression) -> tuple[Expression, Expression]:
    """The smallest subexpressions in which two expressions differ, all that differs being inside them."""
    pairs = list(zip(one.children, other.children, strict=False))
    apart = [pair for pair in pairs if pair[0] != pair[1]]
    same_node = one.symbol == other.symbol and len(apart) == 1
    return _smallest_difference(*apart[0]) if same_node and not apart[0][0].is_vector else (one, other)


def _numbers(node: Expression, path: tuple[int, ...]) -> Iterator[tuple[tuple[int, ...], Expression]]:
    """Every node that has a value, with its path, parents first."""
    yield path, node
    if node.symbol != "dot":
        for place, child in enumerate(node.children):
            yield from _numbers(child, (*path, place))


def _replacements(node: Expression) -> Iterator[tuple[str, Expression]]:
    if grammar.is_constant(node.symbol) and node.symbol not in grammar.CONSTANTS:
        yield from ((SNAPPED, rounded) for rounded in _rounded(grammar.value(node.symbol)))
    yield from ((DELETED, neutral) for neutral in (ZERO, ONE))
    if node.symbol == "dot":
        yield from ((SIMPLIFIED, cosine) for cosine in COSINES)
    elif node.children:
        operator, kept = OPERATORS[node.symbol], node.children
        if operator.neutral is not None:
            # An operand alone is what remains where a neutral 0 or 1 takes the other one's place.
            kept = () if operator.commutative else kept[1:]
        yield from ((SIMPLIFIED, child) for child in kept)


def _in_place_of(name: str, expression: Expression, typical: Mapping[str, float]) -> Iterator[Expression]:
    """What may stand for a parameter: numbers, and the other parameters."""
    yield ZERO
    yield from map(Expression, ROUND)
    if typical[name] >= 0:
        yield from _rounded(typical[name])
    yield from (Expression(other) for other in expression.parameters if other != name)


def _rounded(value: float) -> list[Expression]:
    """A number rounded to one, two and three digits."""
    numbers = (float(f"{value:.{digits}g}") for digits in (1, 2, 3))
    return [Expression(grammar.constant(number)) for number in numbers if isfinite(number)]
