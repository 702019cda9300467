"""The codebank: the subexpressions of existing BRDFs, which Insert draws from (genBRDF paper, section 3.3)."""

from collections.abc import Iterable

from fitters.expressions import Expression, grammar, to_text


def codebank(formulas: Iterable[Expression], parameters: int) -> tuple[str, ...]:
    """Every distinct subexpression that is a number, in text form, smallest first.

    Parameters beyond the first `parameters` wrap around: a fourth parameter of a formula is still some parameter
    where only two are allowed.
    """
    found = {
        wrap_parameters(node, parameters) for formula in formulas for node in formula.walk() if not node.is_vector
    }
    return tuple(to_text(node) for node in sorted(found, key=lambda node: (node.nodes, to_text(node))))


def wrap_parameters(node: Expression, parameters: int) -> Expression:
    """The expression with parameter i renamed to i modulo `parameters`."""
    symbol = node.symbol
    if grammar.is_parameter(symbol):
        symbol = f"p{int(symbol[1:]) % parameters}"
    return Expression(symbol, tuple(wrap_parameters(child, parameters) for child in node.children))
