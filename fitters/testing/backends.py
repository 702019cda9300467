"""The contract of backends that compute values: `check_backend(backend)` asserts what every one must do.

    from fitters.testing.backends import Backend, check_backend
    check_backend(Backend("mine", evaluate))

Every operator is computed at zeros, infinities, NaN and common values, and every formula of the catalogue at
random directions and parameters; what NumPy makes of it (`fitters.expressions.evaluate`) is right.
"""

import itertools
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from fitters.errors import FittersError
from fitters.expressions import Expression, evaluate, grammar, parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.operators import OPERATORS, Operator
from fitters.grid import Array

INF, NAN = np.inf, np.nan
_POSITIVE = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 90.0, INF)
SPECIAL = (*_POSITIVE, *(-value for value in _POSITIVE), 1e-6, 1e5, NAN)
"""What each operand is set to."""

DIRECTIONS = 200
"""At which a formula of the catalogue is computed."""

Evaluate = Callable[[Expression, Mapping[str, float], Array, Array], Array]
"""Values (n,) of an expression at parameters, and at unit directions w_i, w_o (n, 3) above the horizon."""


@dataclass(frozen=True)
class Backend:
    """A backend as the contract sees it.

    evaluate:       see `Evaluate`
    precision:      in which it computes
    tolerance:      relative, of an operator's value; smaller differences than a hundredth of it always pass
    formula_tolerance: relative, of a formula's value
    shown:          what it shows of values, where it does not show all
    left_out:       (operator, operands each (n,)) -> at which of them the operator may differ, (n,)
    """

    name: str
    evaluate: Evaluate
    precision: DTypeLike = np.float64
    tolerance: float = 1e-12
    formula_tolerance: float = 1e-9
    shown: Callable[[Array], Array] | None = None
    left_out: Callable[..., Array] = lambda operator, *operands: np.zeros(len(operands[0]), bool)


def check_backend(backend: Backend) -> None:
    """All checks; raises `AssertionError` that names the backend and what it does wrong."""
    for name in (*grammar.UNARY, *grammar.BINARY):
        check_operator(backend, name)
    for name in CATALOGUE:
        check_formula(backend, name)
    check_lacking(backend)


def check_operator(backend: Backend, name: str) -> None:
    """An operator at all pairs of `SPECIAL`: of cells, of parameters, and of both."""
    arity = OPERATORS[name].arity
    values = list(itertools.product(SPECIAL, repeat=arity))
    operands = np.array(values).T
    left_out = backend.left_out(name, *operands)
    if name == "pow":
        # NumPy's own loops for numbers and for arrays differ about fractional powers.
        left_out = left_out | (operands[0] == -INF)
    up = np.array([[0.0, 0.0, 1.0]])
    everywhere = np.broadcast_to(up, (len(values), 3))
    arrays = {f"p{place}": row for place, row in enumerate(operands)}
    for kinds in itertools.product(("p{}", "p{} * wi.z"), repeat=arity):
        arguments = (parse(kind.format(place)) for place, kind in enumerate(kinds))
        plain = Expression(name, tuple(arguments))
        for expression in (plain,) if backend.shown is None else (plain, Expression("neg", (plain,))):
            expected = evaluate(expression, arrays, everywhere, everywhere)
            given = np.empty(len(values))
            for row, value in enumerate(values):
                parameters = {f"p{place}": number for place, number in enumerate(value)}
                given[row] = backend.evaluate(expression, parameters, up, up)[0]
            judged = np.logical_not(left_out)
            _compare(backend, expression, expected, given, judged, backend.tolerance)


def check_formula(backend: Backend, name: str) -> None:
    """A formula of the catalogue at random directions, its parameters within their bounds."""
    formula, rng = CATALOGUE[name], np.random.default_rng(3)
    w = rng.normal(size=(2, DIRECTIONS, 3))
    w[..., 2] = np.abs(w[..., 2]) + 0.05
    w_i, w_o = w / np.linalg.norm(w, axis=-1, keepdims=True)
    parameters = {
        parameter: float(rng.uniform(low, min(high, 10 * low + 1)))
        for parameter, (low, high) in formula.bounds.items()
    }
    expected = evaluate(formula.expression, parameters, w_i, w_o)
    given = backend.evaluate(formula.expression, parameters, w_i, w_o)
    finite = np.isfinite(expected)
    _compare(backend, formula.expression, expected, given, finite, backend.formula_tolerance, what=name)


def check_lacking(backend: Backend) -> None:
    """An operator that the backend has no way to say is refused by name; no other one takes its place."""
    unsaid = Operator("unsaid", 1, np.negative)
    with temporary(unsaid):
        message = "a number"
        try:
            backend.evaluate(parse("unsaid(p0 * wi.z)"), {"p0": 0.5}, *np.array([[[0.0, 0.0, 1.0]]] * 2))
        except FittersError as error:
            message = str(error)
        assert unsaid.name in message, f"{backend.name}: an operator that it lacks gives {message}"


@contextmanager
def temporary(operator: Operator) -> Iterator[None]:
    """The table of operators with one more."""
    assert operator.name not in OPERATORS
    OPERATORS[operator.name] = operator
    grammar.kind.cache_clear()
    try:
        yield
    finally:
        del OPERATORS[operator.name]
        grammar.kind.cache_clear()


def _compare(
    backend: Backend,
    expression: Expression,
    expected: Array,
    given: Array,
    judged: Array,
    tolerance: float,
    what: str = "",
) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        expected = (backend.shown(expected) if backend.shown else expected).astype(backend.precision)
    np.testing.assert_allclose(
        np.asarray(given)[judged],
        expected[judged],
        rtol=tolerance,
        atol=tolerance / 100,
        err_msg=f"{backend.name}: {what or expression}",
    )
