"""The SymPy backend: for proofs that two formulas are the same. The only module that imports SymPy."""

import operator
from functools import reduce

import numpy as np
import sympy

from fitters.expressions import grammar
from fitters.expressions.expression import Expression
from fitters.expressions.lowered import Walk, lowered
from fitters.expressions.operators import OPERATORS, spelling

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


def _operation(name: str, *operands: sympy.Expr) -> sympy.Expr:
    spelled = spelling(name, "sympy")
    if spelled.startswith("__"):
        return getattr(operator, spelled)(*operands)
    return _power(*operands) if spelled == "Pow" else getattr(sympy, spelled)(*operands)


def to_sympy(expression: Expression) -> sympy.Expr:
    """The SymPy form. Parameters and features (`wi.z`, `wi.wh`, ...) become real symbols of those names.

    Dot products that are always equal share a symbol: w_i . w_h = w_o . w_h, and w_r . w_n = w_i . w_n. Raises
    `FittersError` for an operator that SymPy has no function for.
    """
    form, root = lowered(expression)
    return Walk[sympy.Expr](form, [root]).run(_leaf, _operation)[0]


def _leaf(kind: str, label: float | str) -> sympy.Expr:
    if kind != "const":
        return sympy.Symbol(str(label), real=True)
    symbol = grammar.constant(float(label))
    if symbol == "pi":
        return sympy.pi
    return sympy.Integer(symbol) if symbol.isdigit() else sympy.Float(symbol)


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
    name = type(form).__name__
    arithmetic = {"Add": "add", "Mul": "mul", "Pow": "pow"}
    known = arithmetic.get(name) or next(
        (o.name for o in OPERATORS.values() if o.written and o.sympy == name), None
    )
    if known is not None:
        if grammar.arity(known) == 1:
            return Expression(known, tuple(arguments))
        return reduce(lambda a, b: Expression(known, (a, b)), arguments)
    # SymPy's own rewriting makes these two: sqrt(x^2) = |x|, tan(x + pi/2) = -cot(x).
    if name == "Abs":
        return Expression("max", (arguments[0], Expression("neg", (arguments[0],))))
    if name == "cot":
        return Expression("div", (Expression("1"), Expression("tan", (arguments[0],))))
    raise ValueError(f"{form} has no expression in the grammar: {name}")


def _constant(form: sympy.Expr) -> Expression:
    if form.is_Rational and not form.is_Integer:
        return Expression("div", (_constant(sympy.Integer(form.p)), _constant(sympy.Integer(form.q))))
    value = float(form)
    magnitude = Expression(grammar.constant(abs(value)))
    return Expression("neg", (magnitude,)) if value < 0 else magnitude
