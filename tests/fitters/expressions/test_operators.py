"""The table of operators: meanings against Python's own mathematics, and every fact against values."""

import builtins
import math
import operator as python

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.expressions import operators
from fitters.expressions.lowered import Lowered, lowered
from fitters.expressions.operators import OPERATORS, Linear
from fitters.expressions.text import parse
from fitters.testing.backends import SPECIAL

PYTHON = {
    "neg": python.neg,
    "add": python.add,
    "sub": python.sub,
    "mul": python.mul,
    "div": python.truediv,
    "pow": math.pow,
}
VALUES = np.array([value for value in SPECIAL if np.isfinite(value)])
EVERY = [entry.name for entry in OPERATORS.values()]


def python_function(name):
    return PYTHON.get(name) or getattr(math, name, None) or getattr(builtins, name)


def pairs(values):
    return (axis.ravel() for axis in np.meshgrid(values, values))


def apply(name, *operands):
    with np.errstate(all="ignore"):
        return OPERATORS[name].meaning(*operands)


def same(first, second):
    np.testing.assert_array_equal(np.asarray(first, float), np.asarray(second, float))


@pytest.mark.parametrize("name", EVERY)
def test_the_meaning_is_that_of_pythons_mathematics(name):
    compared = 0
    operands = pairs(VALUES) if OPERATORS[name].arity == 2 else (VALUES,)
    for values in zip(*operands, strict=True):
        try:
            expected = python_function(name)(*map(float, values))
        except (ValueError, ZeroDivisionError, OverflowError):
            continue
        assert apply(name, *values) == pytest.approx(expected, rel=1e-12)
        compared += 1
    assert compared >= 5


def test_the_logarithm_of_zero_keeps_powers_of_zero():
    assert apply("log", 0.0) == operators.ZERO_LOG
    assert np.exp(0.0 * operators.ZERO_LOG) == 1.0


@pytest.mark.parametrize("name", EVERY)
def test_facts_of_every_value_hold(name):
    entry = OPERATORS[name]
    if entry.commutative:
        a, b = pairs(SPECIAL)
        same(apply(name, a, b), apply(name, b, a))
    if entry.neutral is not None:
        same(apply(name, np.array(SPECIAL), entry.neutral), SPECIAL)
    if entry.undoes_itself:
        same(apply(name, apply(name, np.array(SPECIAL))), SPECIAL)
    if entry.opposite:
        a, b = pairs(SPECIAL)
        same(apply(name, a, -b), apply(entry.opposite, a, b))


@pytest.mark.parametrize("name", EVERY)
def test_facts_of_finite_values_hold(name):
    entry = OPERATORS[name]
    for place, value, result in entry.absorbing:
        others = VALUES[VALUES != 0] if name == "div" else VALUES
        operands = [others, others]
        operands[place] = np.full(len(others), value)
        same(apply(name, *operands), np.full(len(others), result))
    if entry.idempotent:
        same(apply(name, VALUES, VALUES), VALUES)
    if entry.inverse:
        a, b = pairs(VALUES[VALUES != 0])
        np.testing.assert_allclose(
            apply(name, a, apply(entry.inverse, entry.neutral, b)), apply(entry.inverse, a, b), rtol=1e-12
        )


@pytest.mark.parametrize("name", EVERY)
def test_what_is_said_not_to_be_negative_is_not(name):
    """Except at -0, whose reciprocal is negative."""
    entry, values = OPERATORS[name], VALUES[(VALUES != 0) | ~np.signbit(VALUES)]
    operands = list(pairs(values)) if entry.arity == 2 else [values]
    signs = zip(*(row >= 0 for row in operands), strict=True)
    known = np.array([entry.non_negative(iter(positive)) for positive in signs])
    assert not np.any(apply(name, *operands)[known] < 0)


@pytest.mark.parametrize("name", EVERY)
def test_linear_operands_are_linear(name):
    entry, rng = OPERATORS[name], np.random.default_rng(0)
    first, second = rng.uniform(0.5, 2, (2, entry.arity, 50))
    places = {
        Linear.NONE: [],
        Linear.FIRST: [[0]],
        Linear.EACH: [[0], [1]],
        Linear.ALL: [list(range(entry.arity))],
    }
    for moved in places[entry.linear]:
        held = [place for place in range(entry.arity) if place not in moved]
        second[held] = first[held]
        middle = apply(name, *(first + second) / 2)
        np.testing.assert_allclose(middle, (apply(name, *first) + apply(name, *second)) / 2, rtol=1e-12)


def test_a_backend_that_lacks_an_operator_says_which():
    with pytest.raises(FittersError, match="shader lacks acos"):
        operators.check_complete("shader", OPERATORS.keys() - {"acos"})
    with pytest.raises(FittersError, match="latex lacks unsaid"):
        operators.spelling("unsaid", "latex")


def test_the_lowered_form_has_features_in_place_of_dot_products():
    def root(text):
        form, node = lowered(parse(text))
        return form.nodes[node]

    assert root("dot(wo, wh)") == root("dot(wh, wi)") == ("feature", "wi.wh")
    assert root("dot(wr, wn)") == root("wr.z") == ("feature", "wi.z")
    assert root("dot(wh, wh)") == ("const", 1.0)
    assert root("dot(wi, wr)")[0] == "sub"


def test_the_lowered_form_as_written_folds_nothing():
    form, root = lowered(parse("1 * p0 + (2 - 2)"))
    assert form.nodes[root][0] == "add"
    simplified = Lowered()
    assert simplified.emit("add", simplified.emit("mul", simplified.const(1.0), simplified.param("p0")), 0) >= 0
