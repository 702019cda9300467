"""Canonical forms: the same value, one form for what is written differently, and nothing merged that differs."""

import numpy as np
import pytest
from hypothesis import given, settings

from fitters.expressions import grammar, parse, to_text
from fitters.expressions.canonical import canonical
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.evaluation import evaluate_features
from tests.random_expressions import random_features, random_tree, trees, wild_parameters


def form(text):
    return canonical(parse(text)).text


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("p0 + wh.z", "wh.z + p0"),
        ("p0 * (wh.z * wi.z)", "(wi.z * p0) * wh.z"),
        ("p0 + (p1 + wh.z)", "(wh.z + p1) + p0"),
        ("p3 * exp(p1 * wi.z)", "p0 * exp(p2 * wi.z)"),
        ("p0 * wh.z + p1 * exp(p1)", "p1 * wh.z + p0 * exp(p0)"),
        ("p0 * 1 + 0", "p0"),
        ("pow(p0, 1) / 1", "p0"),
        ("2 * pi * p0", "p0 * (pi * 2)"),
        ("p0 / 4", "0.25 * p0"),
        ("p0 - (p1 - wh.z)", "wh.z + p0 - p1"),
        ("-(-wh.z) * p0", "p0 * wh.z"),
        ("-p0 * wh.z", "-(wh.z * p0)"),
        ("p0 / wi.z / wo.z", "p0 / (wo.z * wi.z)"),
        ("p0 / (1 / wi.z)", "p0 * wi.z"),
        ("dot(wn, wh)", "wh.z"),
        ("dot(wo, wh)", "dot(wh, wi)"),
        ("dot(wi, wi) * p0", "p0"),
        ("wr.z * p0", "wi.z * p0"),
        ("max(p0, wh.z)", "max(wh.z, p7)"),
        ("p0 * (3 - 1)", "p0 * 2"),
    ],
)
def test_what_computes_the_same_has_one_form(one, other):
    assert form(one) == form(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("p0 - wh.z", "wh.z - p0"),
        ("p0 / wh.z", "wh.z / p0"),
        ("pow(p0, wh.z)", "pow(wh.z, p0)"),
        ("p0 * exp(p1)", "p0 * exp(p0)"),
        ("wi.z / wi.z", "1"),
        ("wi.z - wi.z", "0"),
        ("0 * wi.z", "0"),
        ("pow(wi.z, 0)", "1"),
        ("dot(wo, wr)", "dot(wi, wr)"),
        ("1 / 0", "1 / -0"),
    ],
)
def test_what_may_differ_keeps_its_own_form(one, other):
    assert form(one) != form(other)


@settings(deadline=None, max_examples=300)
@given(trees())
def test_a_canonical_form_is_an_expression_and_its_own_form(tree):
    found = canonical(tree)
    assert form(found.text) == found.text
    assert set(found.names) == set(tree.parameters)
    assert sorted(found.names.values(), key=grammar.number) == [f"p{i}" for i in range(len(found.names))]


def test_values_are_those_of_the_original():
    """3,000 random trees, wild parameters, zeros and poles: where the original is finite, but for rounding."""
    rng = np.random.default_rng(0)
    close = total = 0
    for _ in range(3000):
        tree, parameters, seen = random_tree(rng, 7), wild_parameters(rng), random_features(rng, 30)
        found = canonical(tree)
        renamed = {name: parameters[own] for own, name in found.names.items()}
        plain = evaluate_features(tree, parameters, seen)
        values = evaluate_features(parse(found.text), renamed, seen)
        finite = np.isfinite(plain) & (np.abs(plain) < 1e290)
        total += finite.sum()
        close += np.sum(np.isclose(plain, values, rtol=1e-6, atol=1e-300)[finite])
    assert total > 50_000
    # What is left has no digits that another order of factors would keep, as a sine of 1e40, or divides by a zero
    # whose sign is another.
    assert close >= 0.998 * total


def test_shuffled_sums_and_products_have_one_form():
    """The catalogue's formulas with the operands of every commutative operation exchanged at random."""
    from fitters.expressions import Expression

    rng = np.random.default_rng(1)

    def shuffled(node):
        children = [shuffled(child) for child in node.children]
        if node.symbol in ("add", "mul", "max", "min", "dot") and rng.random() < 0.5:
            children.reverse()
        symbol = f"p{9 - grammar.number(node.symbol)}" if grammar.is_parameter(node.symbol) else node.symbol
        return Expression(symbol, tuple(children))

    for name, published in CATALOGUE.items():
        for _ in range(5):
            assert form(to_text(shuffled(published.expression))) == form(to_text(published.expression)), name
