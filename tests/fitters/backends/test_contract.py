"""Every backend that computes values passes the contract of `fitters.testing.backends`."""

from functools import lru_cache

import numpy as np
import pytest
import sympy

from fitters.backends.double import Double
from fitters.backends.program import lower, lower_whole
from fitters.backends.scalar_code import ScalarCode
from fitters.backends.sympy_form import to_sympy
from fitters.expressions import grammar
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.evaluation import features
from fitters.judging.timing.closures import closure
from fitters.models import FormulaModel
from fitters.testing.backends import Backend, check_formula, check_lacking, check_operator
from tests.fitters.backends.interpreter import combined


def machine_left_out(operator, x, y=None):
    """What float32's functions leave out, which the README of the backends states."""
    if operator == "exp":
        return (x < -69) & (x > -np.inf)
    if operator in ("sin", "cos", "tan"):
        return np.abs(x) >= 1e5
    if operator == "pow":
        # Infinite exponents of 1 and -1, NaN exponents of 1, exponents so large that float32 has no parity, -0.
        left_out = (np.abs(x) == 1) & ~np.isfinite(y)
        left_out |= (x < 0) & ((np.abs(y) >= 90) | np.isinf(x))
        return left_out | ((x == 0) & np.signbit(x))
    return np.zeros(len(x), bool)


def double(expression, parameters, w_i, w_o):
    program = lower(expression)
    engine = Double(program, features(w_i, w_o))
    scalars = engine.scalars({name: np.asarray(value) for name, value in parameters.items()})
    total, columns = engine.outputs(scalars, engine.blocks[0])
    with np.errstate(all="ignore"):
        for name, column in zip(program.linear, columns, strict=True):
            total = total + parameters[name] * column
    return total


def machine(low):
    def evaluate(expression, parameters, w_i, w_o):
        return combined(low(expression), parameters, features(w_i, w_o))

    return evaluate


@lru_cache(maxsize=4)
def compiled(expression):
    code = ScalarCode.of(expression)
    count = len(expression.parameters)
    return code, closure(FormulaModel(expression, np.ones((3, count))))


def scalar_code(expression, parameters, w_i, w_o):
    code, function = compiled(expression)
    given = np.array([[parameters[name] for name in expression.parameters]] * 3).reshape(3, -1)
    function.tables[0][:] = code.prepared(given)
    return function.evaluate(w_i, w_o)[:, 1]


@lru_cache(maxsize=4)
def lambdified(expression):
    form = to_sympy(expression)
    symbols = sorted(form.free_symbols, key=lambda symbol: symbol.name)
    plain = [sympy.Symbol(f"x{i}", real=True) for i in range(len(symbols))]
    function = sympy.lambdify(plain, form.subs(dict(zip(symbols, plain, strict=True)), simultaneous=True), "numpy")
    return [symbol.name for symbol in symbols], function


def with_sympy(expression, parameters, w_i, w_o):
    names, function = lambdified(expression)
    known = features(w_i, w_o) | {name: np.float64(value) for name, value in parameters.items()}
    with np.errstate(all="ignore"):
        return np.broadcast_to(function(*(known[name] for name in names)), len(w_i))


def shown(values):
    """What a renderer sees: 0 for what is negative or not finite."""
    return np.where(np.isfinite(values) & (values > 0), values, 0.0)


FLOAT32 = {"precision": np.float32, "tolerance": 3e-5, "formula_tolerance": 1e-3, "left_out": machine_left_out}
BACKENDS = {
    backend.name: backend
    for backend in (
        Backend("machine, linear parameters apart", machine(lower), **FLOAT32),
        Backend("machine, all per cell", machine(lower_whole), **FLOAT32),
        Backend("double", double),
        Backend("scalar code", scalar_code, shown=shown),
        Backend("SymPy", with_sympy),
    )
}


@pytest.fixture(params=BACKENDS)
def backend(request):
    return BACKENDS[request.param]


@pytest.mark.parametrize("operator", [*grammar.UNARY, *grammar.BINARY])
def test_every_operator(backend, operator):
    check_operator(backend, operator)


@pytest.mark.parametrize("formula", CATALOGUE)
def test_every_published_formula(backend, formula):
    check_formula(backend, formula)


def test_an_operator_that_a_backend_lacks_is_refused_by_name(backend):
    check_lacking(backend)
