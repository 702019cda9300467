"""What Insert draws from."""

import re

from hypothesis import given, settings
from hypothesis import strategies as st

from fitters.expressions import parse, to_text
from fitters.expressions.catalogue import CATALOGUE
from gpsearch.genomes import codebank
from tests.random_expressions import trees


def test_the_codebank_of_phong_traced_by_hand():
    assert codebank([parse("p0 / pi + p1 * pow(max(dot(wr, wo), 0), p2)")], 2) == (
        "0",
        "p0",
        "p1",
        "pi",
        "dot(wr, wo)",
        "p0 / pi",
        "max(dot(wr, wo), 0)",
        "pow(max(dot(wr, wo), 0), p0)",
        "p1 * pow(max(dot(wr, wo), 0), p0)",
        "p0 / pi + p1 * pow(max(dot(wr, wo), 0), p0)",
    )


@settings(deadline=None, max_examples=30)
@given(st.lists(trees(15), min_size=1, max_size=3), st.integers(1, 8))
def test_every_distinct_subexpression_is_there_once_with_its_parameters_wrapped(formulas, parameters):
    bank = codebank(formulas, parameters)
    assert len(set(bank)) == len(bank)
    entries = [parse(text) for text in bank]
    assert not any(entry.is_vector for entry in entries)
    assert all(int(name[1:]) < parameters for entry in entries for name in entry.parameters)
    assert [entry.nodes for entry in entries] == sorted(entry.nodes for entry in entries)
    shapes = {blank(to_text(node)) for formula in formulas for node in formula.walk() if not node.is_vector}
    assert {blank(text) for text in bank} == shapes


def test_a_formula_within_the_parameters_is_in_as_it_is():
    formulas = [formula.expression for formula in CATALOGUE.values() if len(formula.parameters) <= 4]
    bank = set(codebank(formulas, 4))
    for formula in formulas:
        assert {to_text(node) for node in formula.walk() if not node.is_vector} <= bank


def blank(text: str) -> str:
    """A text with all its parameters named alike."""
    return re.sub(r"\bp[0-9]+", "p", text)
