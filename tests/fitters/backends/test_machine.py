"""Every instruction against NumPy, at special values and over dense ranges."""

import numpy as np
import pytest
from numba import njit

from fitters.backends import math32
from fitters.backends.machine import OPCODE, SCALAR_OPCODE, Operands, run_block, run_scalars
from fitters.backends.math32 import FLAGS, load, store
from fitters.expressions.operators import OPERATORS, ZERO_LOG

INF, NAN = np.inf, np.nan
SPECIAL = [
    0.0,
    -0.0,
    0.5,
    -0.5,
    1.0,
    -1.0,
    1.5,
    -1.5,
    2.0,
    -2.0,
    3.0,
    -3.0,
    1e-6,
    1e5,
    90.0,
    -90.0,
    INF,
    -INF,
    NAN,
]
NUMPY = {name: operator.meaning for name, operator in OPERATORS.items()} | {"fill": lambda x: x}


def run_one(opcode, form, x, y):
    """One instruction over vectors x, y, or over every scalar in turn where the form has one."""
    result = np.full(len(x), np.nan, np.float32)

    def once(a, b, scalars, out):
        slots = np.array([a.ctypes.data, b.ctypes.data, out.ctypes.data], np.int64)
        code = [opcode, 2, 0, 0 if len(form) == 1 else 1]
        run_block(np.array([code], np.int32), slots, scalars, len(out))

    if "s" not in form:
        once(x, y, np.zeros(2, np.float32), result)
        return result
    for i in range(len(x)):
        out = np.empty(1, np.float32)
        once(x[i : i + 1].copy(), y[i : i + 1].copy(), np.array([x[i], y[i]], np.float32), out)
        result[i] = out[0]
    return result


@pytest.mark.parametrize(("operator", "form"), OPCODE, ids=lambda value: str(value))
def test_every_instruction_at_special_values(operator, form):
    """As NumPy in float32, but for what float32's exp and log leave out, which the README of the engine states."""
    x, y = (np.array(v, np.float32).ravel() for v in np.meshgrid(SPECIAL, SPECIAL))
    with np.errstate(all="ignore"):
        operands = (x, y)[: max(len(form), 1)]
        expected = NUMPY[operator](*operands).astype(np.float32)
    found = run_one(OPCODE[operator, form], form, x, y)
    left_out = np.zeros(len(x), bool)
    if operator == "exp":
        left_out = (x < -69) & (x > -INF)
    if operator == "pow":
        # Infinite exponents of 1 and -1, NaN exponents of 1, and exponents so large that float32 has no parity.
        left_out = (np.abs(x) == 1) & ~np.isfinite(y)
        left_out |= (np.abs(y) >= 90) & (x < 0)
        left_out |= np.isinf(x) & (x < 0)
        left_out |= (x == 0) & np.signbit(x)
    if operator in ("sin", "cos", "tan"):
        left_out = np.abs(x) >= 1e5
    np.testing.assert_array_equal(np.isnan(found)[~left_out], np.isnan(expected)[~left_out])
    np.testing.assert_allclose(found[~left_out], expected[~left_out], rtol=3e-5, atol=2e-7)


def test_the_named_special_values():
    def value(operator, form, a, b=0.0):
        return run_one(OPCODE[operator, form], form, *(np.array([v], np.float32) for v in (a, b)))[0]

    assert value("pow", Operands.VV, 0, 0) == 1
    assert value("pow", Operands.VV, -2, 3) == pytest.approx(-8, rel=1e-6)
    assert value("pow", Operands.VV, -2, 2) == pytest.approx(4, rel=1e-6)
    assert np.isnan(value("pow", Operands.VV, -2, 0.5))
    assert value("pow", Operands.VV, 0, -1) == INF
    assert value("exp", Operands.V, 100) == INF
    assert value("exp", Operands.V, -70) == 0
    assert value("exp", Operands.V, -68) > 0
    assert value("log", Operands.V, 0) == np.float32(ZERO_LOG)
    assert np.isnan(value("log", Operands.V, -1))
    assert np.isnan(value("asin", Operands.V, 1.0000001))
    assert np.isnan(value("acos", Operands.V, -1.0000001))
    assert np.isnan(value("sqrt", Operands.V, -1e-30))
    assert np.isnan(value("div", Operands.VV, 0, 0))
    assert value("div", Operands.VS, 1, 0) == INF
    assert abs(value("tan", Operands.V, np.float32(np.pi / 2))) > 1e6
    assert np.isnan(value("sin", Operands.V, INF))
    for operator in ("max", "min"):
        assert np.isnan(value(operator, Operands.VV, NAN, 1))
        assert np.isnan(value(operator, Operands.VV, 1, NAN))
        assert np.isnan(value(operator, Operands.VS, 1, NAN))


@pytest.mark.parametrize("operator", SCALAR_OPCODE)
def test_every_scalar_instruction(operator):
    with np.errstate(all="ignore"):
        for x in SPECIAL:
            for y in SPECIAL:
                registers = np.array([x, y, 0.0])
                second = OPERATORS[operator].arity - 1
                run_scalars(np.array([[SCALAR_OPCODE[operator], 2, 0, second]], np.int32), registers)
                if operator == "pow" and x == -INF:
                    # The C library and NumPy's own loops differ about fractional powers.
                    continue
                operands = (np.float64(x), np.float64(y))[: second + 1]
                expected = NUMPY[operator](*operands)
                np.testing.assert_allclose(registers[2], expected, rtol=1e-14, err_msg=f"{operator} {operands}")


def kernel(function):
    @njit(fastmath=FLAGS, error_model="numpy")
    def apply(x, out, n):
        for i in range(n):
            store(out, i, function(load(x, i)))

    return apply


# Function, range, largest relative error, error relative to a value of at least this size.
RANGES = [
    ("exp", -69, 88.3, 4e-7, 0.0),
    ("log", 1e-30, 1e30, 4e-7, 0.0),
    ("log", 0.5, 2.0, 4e-7, 0.0),
    ("sin", -10, 10, 4e-7, 0.0),
    ("sin", -1e4, 1e4, 4e-7, 1e-2),
    ("cos", -10, 10, 4e-7, 1e-3),
    ("cos", -1e4, 1e4, 4e-7, 1e-2),
    ("tan", -1.57, 1.57, 6e-7, 0.0),
    ("tan", -100, 100, 6e-7, 1e-3),
    ("asin", -1, 1, 4e-7, 0.0),
    ("acos", -1, 1, 4e-7, 0.0),
    ("acos", 0.999, 1, 4e-7, 0.0),
    ("atan", -10, 10, 4e-7, 0.0),
    ("atan", -1e6, 1e6, 4e-7, 0.0),
]


@pytest.mark.parametrize(("name", "low", "high", "bound", "least"), RANGES)
def test_accuracy(name, low, high, bound, least, record_property):
    x = np.geomspace(low, high, 1_000_001) if name == "log" and low < 0.1 else np.linspace(low, high, 1_000_001)
    x = x.astype(np.float32)
    out = np.empty_like(x)
    kernel(getattr(math32, name))(x.ctypes.data, out.ctypes.data, len(x))
    reference = {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan}.get(name) or getattr(np, name)
    exact = reference(x.astype(np.float64))
    scale = np.maximum(np.abs(exact), max(least, 1e-30))
    error = np.max(np.abs(out - exact) / scale)
    record_property("largest relative error", float(error))
    assert error < bound


def test_power_is_accurate_to_its_exponential():
    """Relative error grows with |b log a|, here up to 69: some 3e-7 per unit of the exponent's rounding."""
    rng = np.random.default_rng(0)
    a = np.exp(rng.uniform(-20, 20, 300_000)).astype(np.float32)
    b = (rng.uniform(-69, 69, a.size) / np.maximum(np.abs(np.log(a)), 1e-3)).astype(np.float32)
    found = run_one(OPCODE["pow", Operands.VV], Operands.VV, a, b)
    exact = np.power(a.astype(np.float64), b.astype(np.float64))
    exponent = np.abs(b.astype(np.float64) * np.log(a.astype(np.float64)))
    assert np.max(np.abs(found / exact - 1) / (1 + exponent)) < 4e-7
