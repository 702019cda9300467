"""How random edits are drawn, and what Insert draws from."""

import re
from collections import Counter
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from fitters.expressions import Expression, parse, to_text
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.expression import MAX_DEPTH
from gpsearch.genomes import Genome, Mutation, codebank, random_edit, reify
from gpsearch.genomes.genome import draft
from tests.gpsearch.genomes.test_genome import MUTATION, STARTS
from tests.random_expressions import trees

KINDS = ("Swap", "Insert", "Replace", "Delete")


def kinds(mutation: Mutation, count: int = 400) -> Counter[str]:
    rng, made = np.random.default_rng(0), draft(Genome(STARTS[0]))
    return Counter(type(random_edit(made, mutation, rng)).__name__ for _ in range(count))


@pytest.mark.parametrize("only", range(4))
def test_a_frequency_of_0_rules_an_edit_out(only):
    frequencies = tuple(float(i == only) for i in range(4))
    assert kinds(Mutation(MUTATION.codebank, 90, 4, frequencies), 50) == {KINDS[only]: 50}


def test_replacements_of_one_node_are_equally_frequent():
    rng = np.random.default_rng(1)
    mutation = Mutation(("1",), 90, 2, (0, 0, 1, 0))
    drawn = Counter(random_edit(draft(Genome("p0")), mutation, rng).symbol for _ in range(2000))
    assert set(drawn) == {"p1", "1", "2", "pi", "4", "wi.z", "wo.z", "wh.z", "wr.z"}
    assert stats.chisquare(list(drawn.values())).pvalue > 1e-3


def test_the_draft_is_left_as_it_was():
    made = draft(Genome(STARTS[0]))
    before = deepcopy(made)
    rng = np.random.default_rng(2)
    for _ in range(100):
        random_edit(made, MUTATION, rng)
    assert made == before


def test_the_same_generator_state_draws_the_same_edit():
    made = draft(Genome(STARTS[0]))
    drawn = [random_edit(made, MUTATION, np.random.default_rng(seed)) for seed in (3, 3, 4)]
    assert drawn[0] == drawn[1] != drawn[2]


def test_where_nothing_fits_a_constant_takes_the_roots_place():
    mutation = Mutation((STARTS[0],), max_nodes=5, parameters=4, frequencies=(0, 1, 0, 0))
    edit = random_edit(draft(Genome("p0 / pi")), mutation, np.random.default_rng(0))
    assert to_text(reify(Genome("p0 / pi", (edit,)))) == "1"


@pytest.mark.parametrize("frequencies", [(1, 0, 0, 0), (0, 1, 0, 0), (1, 1, 1, 1)])
def test_no_edit_makes_a_tree_deeper_than_the_language_allows(frequencies):
    """With hundreds of nodes allowed, depth is the nearer limit."""
    tower = Expression("p0")
    for _ in range(MAX_DEPTH - 10):
        tower = Expression("sin", (tower,))
    start = Expression("add", (tower, tower))
    bank = codebank([start], 1)
    mutation = Mutation(bank, max_nodes=1000, parameters=1, frequencies=frequencies)
    genome, rng = Genome(to_text(start)), np.random.default_rng(5)
    for _ in range(25):
        genome = genome.with_edit(random_edit(draft(genome), mutation, rng))
        assert reify(genome).depth <= MAX_DEPTH


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
