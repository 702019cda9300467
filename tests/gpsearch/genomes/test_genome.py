"""Genomes under many random edits and crossovers."""

import json

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fitters.expressions import parse, to_text
from fitters.expressions.catalogue import CATALOGUE
from gpsearch.genomes import Genome, Mutation, codebank, crossover, random_edit, reify
from gpsearch.genomes.genome import draft

STARTS = tuple(to_text(CATALOGUE[name].expression) for name in ("cook-torrance", "phong", "ggx"))
MUTATION = Mutation(
    codebank=codebank([formula.expression for formula in CATALOGUE.values()], 4), max_nodes=90, parameters=4
)
SEEDS = st.integers(0, 2**32)
QUICKLY = settings(deadline=None, max_examples=30)


def mutated(genome: Genome, rng: np.random.Generator, mutation: Mutation = MUTATION) -> Genome:
    return genome.with_edit(random_edit(draft(genome), mutation, rng))


def family(seed: int, generations: int, start: str | None = None) -> list[Genome]:
    """Four genomes of so many edits that have exchanged their ends at every step, whatever that makes of them."""
    rng = np.random.default_rng(seed)
    members = [Genome(start or STARTS[int(rng.integers(len(STARTS)))]) for _ in range(4)]
    for generation in range(generations):
        order = rng.permutation(4)
        members = [members[i] for i in order]
        cut = int(rng.integers(generation + 1))
        members = [*crossover(members[0], members[1], cut), *members[2:]]
        members = [mutated(member, rng) for member in members]
    return members


@QUICKLY
@given(SEEDS, st.integers(1, 15))
def test_whatever_edits_and_crossovers_make_is_an_expression_of_the_allowed_parameters(seed, generations):
    for genome in family(seed, generations):
        expression = reify(genome)
        assert parse(to_text(expression)) == expression
        assert set(expression.parameters) <= {"p0", "p1", "p2", "p3"}
        made = draft(genome)
        assert len(made.symbols) == expression.nodes
        assert made.within_limits(expression.nodes)
        assert not made.within_limits(expression.nodes - 1)


@QUICKLY
@given(SEEDS, st.integers(1, 15))
def test_random_edits_alone_keep_within_the_limits_and_always_change_something(seed, count):
    rng = np.random.default_rng(seed)
    genome = Genome(STARTS[1])
    mutation = Mutation(codebank([parse(start) for start in STARTS], 3), max_nodes=30, parameters=3)
    for _ in range(count):
        changed = mutated(genome, rng, mutation)
        assert reify(changed) != reify(genome)
        assert reify(changed).nodes <= 30
        assert set(reify(changed).parameters) <= {"p0", "p1", "p2"}
        genome = changed


@QUICKLY
@given(SEEDS, st.integers(1, 15))
def test_members_of_a_generation_have_equally_many_edits_none_twice_and_one_label_per_node(seed, generations):
    for genome in family(seed, generations):
        assert len(genome.edits) == generations
        brought = [edit.label for edit in genome.edits if hasattr(edit, "label")]
        assert len(set(brought)) == len(brought)


@QUICKLY
@given(SEEDS, st.integers(1, 15), st.data())
def test_crossover_exchanges_ends_and_undoes_itself(seed, generations, data):
    first, second, *_ = family(seed, generations)
    cut = data.draw(st.integers(0, generations))
    one, other = crossover(first, second, cut)
    assert (one.start, other.start) == (first.start, second.start)
    assert one.edits == first.edits[:cut] + second.edits[cut:]
    assert other.edits == second.edits[:cut] + first.edits[cut:]
    assert crossover(one, other, cut) == (first, second)


@QUICKLY
@given(SEEDS, st.integers(0, 15))
def test_genomes_go_through_json(seed, generations):
    for genome in family(seed, generations):
        assert Genome.from_json(genome.start, json.loads(json.dumps(genome.to_json()))) == genome


@QUICKLY
@given(SEEDS, st.integers(1, 15))
def test_surviving_nodes_keep_their_labels(seed, generations):
    """The leaves of a start, told apart by their numbers, still carry the labels they began with."""
    start = " + ".join(f"pow(wh.z, 0.{i}1)" for i in range(6))
    before = {label: symbol for label, symbol in draft(Genome(start)).symbols.items() if symbol.startswith("0.")}
    for genome in family(seed, generations, start):
        replaced = {edit.at for edit in genome.edits if type(edit).__name__ == "Replace"}
        made = draft(genome)
        for label, symbol in before.items():
            if label in made.symbols and label not in replaced:
                assert made.symbols[label] == symbol
        numbers = [symbol for label, symbol in made.symbols.items() if label not in replaced]
        assert len([n for n in numbers if n in before.values()]) == len(set(numbers) & set(before.values()))
