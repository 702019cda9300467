"""The one table of operators: what each means, what is known of it, and how the backends say it.

To add an operator, add its entry here and its row in the table of the register machine (`backends/machine.py`),
whose loops are compiled. The grammar, the text form, the canonical form, simplification, the lowered form and all
other backends read this table. A backend that has no way to say an operator raises `FittersError` with both names.
"""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fitters.errors import FittersError

SUM, PRODUCT, PREFIX, CALL = 1, 2, 3, 4
"""Precedences: how tightly an operator binds its operands in the text form."""

ZERO_LOG = -1e38
"""What every backend takes for log(0): times 0 it is 0, times anything else exp makes it 0 or infinite."""


class Linear(Enum):
    """In which operands an operator is linear while the others are held."""

    NONE = "none"
    ALL = "all of them together"
    EACH = "each one alone"
    FIRST = "the first"


def _never(operands: Iterable[bool]) -> bool:
    return False


def _always(operands: Iterable[bool]) -> bool:
    return True


def _first(operands: Iterable[bool]) -> bool:
    return next(iter(operands))


@dataclass(frozen=True)
class Operator:
    """One operator.

    meaning:      in NumPy, for float64 arrays
    written:      whether the grammar has it; the others come up when an expression is rearranged
    sign:         in the text form, between two operands or before one; an operator without is written as a call
    precedence:   of the text form, one of `SUM PRODUCT PREFIX CALL`

    Facts that hold for every value, NaN and infinity too (except for the sign of a zero):
    commutative:  f(a, b) = f(b, a)
    neutral:      f(a, neutral) = a, and f(neutral, a) = a where it commutes
    undoes_itself: f(f(a)) = a
    opposite:     the operator g with f(a, -b) = g(a, b)

    Facts that hold except for rounding, or for finite values only:
    absorbing:    (place, value, result): with that value as the operand of that place, the result is known
    idempotent:   f(a, a) = a
    inverse:      the operator g with f(a, g(neutral, b)) = g(a, b)

    Facts about what comes out:
    non_negative: whether the result is certainly not negative, from which operands are not (and none is -0)
    linear:       in which operands

    How backends say it; None where that backend has no way:
    sympy:        name of SymPy's function; of Python's operator where it begins with `__`
    latex:        LaTeX with {0} and {1} for the operands
    llvm:         for scalar code: an instruction, an intrinsic (`llvm.sin`), or `call tan` for the C library
    """

    name: str
    arity: int
    meaning: Callable[..., Any]
    written: bool = True
    sign: str = ""
    precedence: int = CALL
    commutative: bool = False
    neutral: float | None = None
    undoes_itself: bool = False
    opposite: str = ""
    absorbing: tuple[tuple[int, float, float], ...] = ()
    idempotent: bool = False
    inverse: str = ""
    non_negative: Callable[[Iterable[bool]], bool] = _never
    linear: Linear = Linear.NONE
    sympy: str | None = None
    latex: str | None = None
    llvm: str | None = None


def _log(x: ArrayLike) -> np.ndarray:
    """The logarithm that powers are rearranged with: finite at 0, so that 0^0 stays 1."""
    return np.where(x == 0, ZERO_LOG, np.log(np.where(x == 0, 1.0, x)))


def _function(name: str, meaning: Callable[..., Any], latex: str, llvm: str, **facts: Any) -> Operator:
    """A function of one operand that SymPy knows by the same name."""
    return Operator(name, 1, meaning, latex=latex + r"\left({0}\right)", llvm=llvm, sympy=name, **facts)


_ENTRIES = (
    Operator(
        "neg",
        1,
        np.negative,
        sign="-",
        precedence=PREFIX,
        undoes_itself=True,
        linear=Linear.ALL,
        sympy="__neg__",
        latex="-{0}",
        llvm="fneg",
    ),
    _function("sin", np.sin, r"\sin", "llvm.sin"),
    _function("cos", np.cos, r"\cos", "llvm.cos"),
    _function("tan", np.tan, r"\tan", "call tan"),
    _function("exp", np.exp, r"\exp", "llvm.exp", non_negative=_always),
    _function("asin", np.arcsin, r"\arcsin", "call asin"),
    _function("acos", np.arccos, r"\arccos", "call acos", non_negative=_always),
    _function("atan", np.arctan, r"\arctan", "call atan"),
    Operator("sqrt", 1, np.sqrt, non_negative=_always, sympy="sqrt", latex=r"\sqrt{{{0}}}", llvm="llvm.sqrt"),
    Operator(
        "add",
        2,
        np.add,
        sign="+",
        precedence=SUM,
        commutative=True,
        neutral=0.0,
        opposite="sub",
        non_negative=all,
        linear=Linear.ALL,
        sympy="__add__",
        latex="{0} + {1}",
        llvm="fadd",
    ),
    Operator(
        "sub",
        2,
        np.subtract,
        sign="-",
        precedence=SUM,
        neutral=0.0,
        opposite="add",
        linear=Linear.ALL,
        sympy="__sub__",
        latex="{0} - {1}",
        llvm="fsub",
    ),
    Operator(
        "mul",
        2,
        np.multiply,
        sign="*",
        precedence=PRODUCT,
        commutative=True,
        neutral=1.0,
        absorbing=((0, 0.0, 0.0), (1, 0.0, 0.0)),
        inverse="div",
        non_negative=all,
        linear=Linear.EACH,
        sympy="__mul__",
        latex=r"{0} \, {1}",
        llvm="fmul",
    ),
    Operator(
        "div",
        2,
        np.divide,
        sign="/",
        precedence=PRODUCT,
        neutral=1.0,
        absorbing=((0, 0.0, 0.0),),
        non_negative=all,
        linear=Linear.FIRST,
        sympy="__truediv__",
        latex=r"\frac{{{0}}}{{{1}}}",
        llvm="fdiv",
    ),
    Operator(
        "max",
        2,
        np.maximum,
        commutative=True,
        idempotent=True,
        non_negative=any,
        sympy="Max",
        latex=r"\max\left({0}, {1}\right)",
        llvm="llvm.maximum",
    ),
    Operator(
        "min",
        2,
        np.minimum,
        commutative=True,
        idempotent=True,
        non_negative=all,
        sympy="Min",
        latex=r"\min\left({0}, {1}\right)",
        llvm="llvm.minimum",
    ),
    Operator(
        "pow",
        2,
        np.power,
        neutral=1.0,
        absorbing=((0, 1.0, 1.0), (1, 0.0, 1.0)),
        non_negative=_first,
        sympy="Pow",
        latex="{0}^{{{1}}}",
        llvm="llvm.pow",
    ),
    _function("log", _log, r"\ln", "llvm.log", written=False),
)

OPERATORS: dict[str, Operator] = {entry.name: entry for entry in _ENTRIES}
"""By name; `dot`, which takes vectors, is not one of them: the lowered form has none."""


def spelling(name: str, form: str) -> str:
    """How a backend says an operator, `form` being `sympy`, `latex` or `llvm`.

    Raises `FittersError` where it has no way to say it.
    """
    text = getattr(OPERATORS[name], form) if name in OPERATORS else None
    if text is None:
        raise lacking(form, [name])
    return text


def lacking(backend: str, names: Collection[str]) -> FittersError:
    """The error of a backend that has no way to say some operators."""
    return FittersError(
        f"the backend {backend} lacks {', '.join(names)}: an operator needs an entry in "
        "fitters/expressions/operators.py that says it there, and a row in fitters/backends/machine.py"
    )


def check_complete(backend: str, table: Collection[str]) -> None:
    """Raises `FittersError` where a backend's own table, keyed by name, lacks an operator."""
    missing = [name for name in OPERATORS if name not in table]
    if missing:
        raise lacking(backend, missing)
