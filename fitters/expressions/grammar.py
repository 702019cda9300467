"""The grammar of BRDF expressions, Figure 4 of the genBRDF paper: which symbols there are and what they take.

A symbol is a short name. Operators are those of `operators.py` and `dot`; leaves are vectors `wi`, components
`wh.z`, parameters `p0` and constants. Figure 4 draws from the constants 1, 2, pi and 4; published formulas need
others (the 5 of Schlick's Fresnel term), so any finite non-negative decimal literal is a constant of the language.
"""

import math
import re
from functools import lru_cache

from fitters.expressions.operators import OPERATORS

UNARY = tuple(name for name, operator in OPERATORS.items() if operator.written and operator.arity == 1)
BINARY = tuple(name for name, operator in OPERATORS.items() if operator.written and operator.arity == 2)
VECTORS = ("wi", "wo", "wh", "wr", "wn")
COMPONENTS = ("wi.z", "wo.z", "wh.z", "wr.z")
CONSTANTS = ("1", "2", "pi", "4")

_PARAMETER = re.compile(r"p(0|[1-9][0-9]?)")


def arity(symbol: str) -> int:
    """How many children a node of this symbol has: 0, 1 or 2."""
    if symbol in OPERATORS:
        return OPERATORS[symbol].arity
    return 2 if symbol == "dot" else 0


@lru_cache(maxsize=4096)
def kind(symbol: str) -> str:
    """One of `unary binary dot vector component parameter constant`, or an empty string for no symbol at all."""
    if symbol in OPERATORS:
        return ("unary", "binary")[OPERATORS[symbol].arity - 1] if OPERATORS[symbol].written else ""
    if symbol == "dot":
        return "dot"
    if symbol in VECTORS:
        return "vector"
    if symbol in COMPONENTS:
        return "component"
    if _PARAMETER.fullmatch(symbol):
        return "parameter"
    return "constant" if is_constant(symbol) else ""


MIRRORED = "2 wi.z^2 - 1"
"""What `feature` calls w_i . w_r, which follows from `wi.z`."""


def feature(*symbols: str) -> str:
    """What a component or the dot product of two vectors is.

    A component (`wr.z` is `wi.z`), a pair of vectors such as `wi.wh`, `1` for a vector with itself, or `MIRRORED`.
    """
    if len(symbols) == 1:
        return "wi.z" if symbols == ("wr.z",) else symbols[0]
    first, second = sorted(symbols)
    if first == second:
        return "1"
    if "wn" in symbols:
        return feature(f"{second if first == 'wn' else first}.z")
    if (first, second) == ("wi", "wr"):
        return MIRRORED
    return {"wh.wi": "wi.wh", "wh.wo": "wi.wh"}.get(f"{first}.{second}", f"{first}.{second}")


def is_parameter(symbol: str) -> bool:
    return kind(symbol) == "parameter"


def number(parameter: str) -> int:
    """The 3 of `p3`."""
    return int(parameter[1:])


def is_constant(symbol: str) -> bool:
    return symbol == "pi" or (symbol[:1].isdigit() and _finite(symbol) and constant(float(symbol)) == symbol)


def constant(value: float) -> str:
    """The one symbol of a constant: `2` for 2.0, `0.5`, `1e-05`. Raises `ValueError` where it is no constant."""
    if not (math.isfinite(value) and value >= 0):
        raise ValueError(f"{value} is no constant: a constant is finite and not negative (write neg as -x)")
    if value == math.pi:
        return "pi"
    return repr(int(value)) if value == int(value) and value < 1e15 else repr(float(value))


def value(symbol: str) -> float:
    """The number that a constant's symbol stands for."""
    return math.pi if symbol == "pi" else float(symbol)


def _finite(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
