"""Expressions as SymPy objects: for simplification, for proofs of equivalence, for LaTeX."""

from functools import reduce

import numpy as np
import sympy

from fitters.expressions import grammar
from fitters.expressions.evaluation import dot_feature
from fitters.expressions.expression import Expression

_EXACT_BITS = 1024
"""Powers of numbers with more digits are held as floating-point numbers."""


def _power(base: sympy.Expr, exponent: sympy.Expr) -> sympy.Expr:
    # SymPy writes whole powers out, in (2 p0)^n too: 4^(4^16) would fill the memory.
    if not (exponent.is_Number and exponent.is_finite and abs(exponent) > 1):
        return sympy.Pow(base, exponent)
    if base.is_Rational and abs(exponent) * max(base.p.bit_length(), base.q.bit_length()) > _EXACT_BITS:
        with np.errstate(all="ignore"):
            return sympy.Float(float(np.float64(float(base)) ** np.float64(float(exponent))))
    return sympy.Pow(base, exponent if abs(exponent) <= _EXACT_BITS else sympy.Float(exponent))


_FUNCTIONS = {
    "neg": lambda a: -a,
    "sin": sympy.sin,
    "cos": sympy.cos,
    "tan": sympy.tan,
    "exp": sympy.exp,
    "asin": sympy.asin,
    "acos": sympy.acos,
    "atan": sympy.atan,
    "sqrt": sympy.sqrt,
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "max": sympy.Max,
    "min": sympy.Min,
    "pow": _power,
}


def to_sympy(expression: Expression) -> sympy.Expr:
    """The SymPy form. Parameters and features (`wi.z`, `wi.wh`, ...) become real symbols of those names.

    Dot products that are always equal share a symbol: w_i . w_h = w_o . w_h, and w_r . w_n = w_i . w_n.
    """
    if expression.symbol == "dot":
        name = dot_feature(expression.children[0].symbol, expression.children[1].symbol)
        if name == "1":
            return sympy.Integer(1)
        if name == "2 wi.z^2 - 1":
            return 2 * _symbol("wi.z") ** 2 - 1
        return _symbol(name)
    if expression.children:
        return _FUNCTIONS[expression.symbol](*(to_sympy(child) for child in expression.children))
    kind = grammar.kind(expression.symbol)
    if kind == "constant":
        return _number(expression.symbol)
    return _symbol("wi.z" if expression.symbol == "wr.z" else expression.symbol)


def from_sympy(form: sympy.Expr) -> Expression:
    """The expression of a SymPy form over the symbols that `to_sympy` makes. Raises `ValueError` for others."""
    if form.is_Symbol:
        name = form.name
        if "." in name and not name.endswith(".z"):
            first, second = name.split(".")
            return Expression("dot", (Expression(first), Expression(second)))
        return Expression(name)
    if form == sympy.pi:
        return Expression("pi")
    if form.is_Number or form == sympy.E:
        return _constant(form)
    arguments = [from_sympy(argument) for argument in form.args]
    folded = {sympy.Add: "add", sympy.Mul: "mul", sympy.Max: "max", sympy.Min: "min"}
    for function, symbol in folded.items():
        if isinstance(form, function):
            return reduce(lambda a, b: Expression(symbol, (a, b)), arguments)
    if isinstance(form, sympy.exp):
        return Expression("exp", tuple(arguments))
    if form.is_Pow:
        return Expression("pow", tuple(arguments))
    # SymPy's own rewriting makes these two: sqrt(x^2) = |x|, tan(x + pi/2) = -cot(x).
    if isinstance(form, sympy.Abs):
        return Expression("max", (arguments[0], Expression("neg", (arguments[0],))))
    if isinstance(form, sympy.cot):
        return Expression("div", (Expression("1"), Expression("tan", (arguments[0],))))
    name = type(form).__name__
    if name in grammar.UNARY:
        return Expression(name, tuple(arguments))
    raise ValueError(f"{form} has no expression in the grammar: {name}")


def _symbol(name: str) -> sympy.Symbol:
    return sympy.Symbol(name, real=True)


def _number(symbol: str) -> sympy.Expr:
    if symbol == "pi":
        return sympy.pi
    return sympy.Integer(symbol) if symbol.isdigit() else sympy.Float(symbol)


def _constant(form: sympy.Expr) -> Expression:
    if form.is_Rational and not form.is_Integer:
        return Expression("div", (_constant(sympy.Integer(form.p)), _constant(sympy.Integer(form.q))))
    value = float(form)
    magnitude = Expression(grammar.constant(abs(value)))
    return Expression("neg", (magnitude,)) if value < 0 else magnitude
