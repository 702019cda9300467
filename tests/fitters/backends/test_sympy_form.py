"""The SymPy form means the same, and comes back."""

import contextlib
import time

import numpy as np
import pytest
import sympy

from fitters.backends.sympy_form import from_sympy, to_sympy
from fitters.expressions import evaluate, parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.evaluation import evaluate_features, features
from tests.random_expressions import random_directions, random_features, random_tree

PARAMETERS = {f"p{i}": value for i, value in enumerate((0.3, 1.7, 0.4, 0.2, 1.5, 0.1, 2.0, 1.2, 5.0, 1.1))}


def lambdified(form, seen, parameters):
    symbols = sorted(form.free_symbols, key=lambda symbol: symbol.name)
    names = [f"x{i}" for i in range(len(symbols))]
    plain = form.subs(dict(zip(symbols, map(sympy.Symbol, names), strict=True)))
    values = [seen[s.name] if s.name in seen else parameters[s.name] for s in symbols]
    return sympy.lambdify(list(map(sympy.Symbol, names)), plain, "numpy")(*values)


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_sympy_form_of_a_formula_has_its_values(name):
    w_i, w_o = random_directions(np.random.default_rng(7), 400)
    expression = CATALOGUE[name].expression
    expected = evaluate(expression, PARAMETERS, w_i, w_o)
    found = lambdified(to_sympy(expression), features(w_i, w_o), PARAMETERS)
    np.testing.assert_allclose(np.broadcast_to(found, expected.shape), expected, rtol=1e-9)


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_formula_comes_back_from_sympy(name):
    w_i, w_o = random_directions(np.random.default_rng(8), 400)
    expression = CATALOGUE[name].expression
    again = from_sympy(to_sympy(expression))
    np.testing.assert_allclose(
        evaluate(again, PARAMETERS, w_i, w_o), evaluate(expression, PARAMETERS, w_i, w_o), rtol=1e-9
    )
    assert set(again.parameters) == set(expression.parameters)


def test_random_trees_come_back_from_sympy():
    """Where SymPy stays real, and within what its rewriting does to the domain: both finite, both alike."""
    rng = np.random.default_rng(9)
    seen = random_features(rng, 200)
    back = agreed = 0
    for _ in range(300):
        tree = random_tree(rng, 5)
        try:
            again = from_sympy(to_sympy(tree))
        except ValueError:
            continue
        back += 1
        a, b = (evaluate_features(e, PARAMETERS, seen) for e in (tree, again))
        both = np.isfinite(a) & np.isfinite(b)
        agreed += np.allclose(a[both], b[both], rtol=1e-6, atol=1e-9)
    assert back >= 200
    assert agreed >= 0.99 * back


def test_equal_dot_products_share_a_symbol():
    assert to_sympy(parse("dot(wi, wh) - dot(wo, wh)")) == 0
    assert to_sympy(parse("dot(wr, wn) - dot(wi, wn) + wh.z - dot(wn, wh)")) == 0
    assert to_sympy(parse("dot(wh, wh)")) == 1
    assert to_sympy(parse("dot(wi, wr) - (2 * wi.z * wi.z - 1)")) == 0


def test_sympy_proves_that_oren_nayar_without_roughness_is_lambert():
    rough = to_sympy(CATALOGUE["oren-nayar"].expression)
    assert rough.subs(sympy.Symbol("p1", real=True), 0) == to_sympy(CATALOGUE["lambert"].expression)


@pytest.mark.parametrize(
    ("text", "meaning"),
    [("sqrt(wi.wo2 * wi.wo2)".replace("wi.wo2", "dot(wi, wo)"), "|x|"), ("tan(p0 + pi / 2)", "-cot x")],
)
def test_what_sympy_rewrites_comes_back(text, meaning):
    seen = random_features(np.random.default_rng(10), 100)
    expression = parse(text)
    again = from_sympy(to_sympy(expression))
    np.testing.assert_allclose(
        evaluate_features(again, PARAMETERS, seen), evaluate_features(expression, PARAMETERS, seen), rtol=1e-9
    )


@pytest.mark.parametrize(
    "text",
    [
        "pow(4, pow(4, 4 * 4))",
        "pow(4, pow(4, pow(4, pow(4, 4))))",
        "pow(pow(2, 1e5), 1e5)",
        "pow(2 * p0, pow(4, 4 * 4)) * 4",
        "pow(pow(pow(pow(pow(pow(4, 50), 50), 50), 50), 50), 50)",
        "exp(pow(4, 4 * 4))",
        "pow(0 - 2, 1e9 + 0.5)",
        "pow(0, -1e9)",
        "sin(pow(4, pow(4, 4 * 4)))",
    ],
)
def test_towers_of_powers_are_not_written_out(text):
    start = time.perf_counter()
    form = to_sympy(parse(text))
    assert time.perf_counter() - start < 5
    with contextlib.suppress(ValueError):
        from_sympy(form)


@pytest.mark.parametrize(
    "form",
    [sympy.I, sympy.nan, sympy.oo, sympy.zoo, sympy.Symbol("x"), sympy.gamma(sympy.Symbol("p0", real=True))],
)
def test_what_the_grammar_cannot_say_is_refused(form):
    with pytest.raises(ValueError):  # noqa: PT011
        from_sympy(form)
