"""Breeding, survival and migration as pure functions."""

import hashlib
import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from math import inf

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from fitters.expressions import parse, to_text
from fitters.expressions.catalogue import CATALOGUE
from gpsearch.evolution.island import Breeding, Individual, Island, Role, advance, generator, migrate, survive
from gpsearch.genomes import Genome, Mutation, Replace, codebank, reify

FORMULAS = [CATALOGUE[name].expression for name in ("phong", "blinn-phong", "cook-torrance")]
BREEDING = Breeding(
    starts=(to_text(FORMULAS[0]), to_text(FORMULAS[1])),
    size=12,
    tournament=3,
    mutation=Mutation(codebank(FORMULAS, 4), max_nodes=40, parameters=4),
)
SEEDS = st.integers(0, 2**63 - 1)


def make_believe_error(expression: str) -> float:
    """An error that depends on the expression alone, now and then infinite."""
    number = int.from_bytes(hashlib.sha256(expression.encode()).digest()[:4], "little") / 2**32
    return inf if number > 0.9 else number


def grown(seed: int, generations: int, breeding: Breeding = BREEDING, number: int = 0) -> Island:
    island = Island(number)
    for _ in range(generations):
        brood = advance(island, breeding, seed)
        island = survive(
            island, brood, {child.expression: make_believe_error(child.expression) for child in brood}
        )
    return island


def ranked(count: int) -> Island:
    """A population whose individuals are told apart by their one edit, the best first."""
    individuals = tuple(
        Individual(Genome("p0", (Replace(f"node {i}", "p1"),)), "p0", 1, error=i / count) for i in range(count)
    )
    return Island(0, 1, individuals)


def test_founders_are_starts_with_one_edit_each_the_starts_in_turn():
    founders = advance(Island(0), BREEDING, 1)
    assert len(founders) == BREEDING.size
    assert all(len(founder.genome.edits) == 1 for founder in founders)
    assert [founder.genome.start for founder in founders] == list(BREEDING.starts) * 6
    assert all(founder.expression != founder.genome.start for founder in founders)


@settings(deadline=None, max_examples=20)
@given(SEEDS, st.integers(0, 8), st.sampled_from([4, 6, 12]))
def test_a_generation_has_n_offspring_of_which_half_extend_a_parent_by_one_edit(seed, generations, size):
    breeding = replace(BREEDING, size=size)
    island = grown(seed, generations, breeding)
    brood = advance(island, breeding, seed)
    assert len(brood) == size
    assert {len(child.genome.edits) for child in brood} == {generations + 1}
    if generations:
        parents = {individual.genome for individual in island.population}
        bodies = [replace(child.genome, edits=child.genome.edits[:-1]) for child in brood]
        assert all(body in parents for body in bodies[: size // 2])
        origins = {edit for parent in parents for edit in parent.edits}
        assert all(set(body.edits) <= origins for body in bodies)


@settings(deadline=None, max_examples=20)
@given(SEEDS, st.integers(0, 8))
def test_offspring_keep_the_limits_and_state_the_expression_of_their_genome(seed, generations):
    for child in advance(grown(seed, generations), BREEDING, seed):
        expression = reify(child.genome)
        assert (child.expression, child.nodes) == (to_text(expression), expression.nodes)
        assert parse(child.expression) == expression
        assert child.nodes <= BREEDING.mutation.max_nodes
        assert set(expression.parameters) <= {"p0", "p1", "p2", "p3"}


def test_crossover_that_would_break_the_limits_gives_way_to_a_parent():
    """Starts of nearly the largest size, many of whose offspring would be too large."""
    breeding = replace(BREEDING, size=40, mutation=replace(BREEDING.mutation, max_nodes=14))
    for seed in range(5):
        island = grown(seed, 10, breeding)
        assert max(individual.nodes for individual in island.population) <= 14


def test_advance_is_a_pure_function():
    island = grown(7, 3)
    assert advance(island, BREEDING, 7) == advance(island, BREEDING, 7)
    np.random.seed(0)  # noqa: NPY002
    np.random.random(3)  # noqa: NPY002
    assert advance(island, BREEDING, 7) == advance(grown(7, 3), BREEDING, 7)


def test_advance_does_not_depend_on_the_process():
    """Hashes of strings differ between processes; nothing may hang on them."""
    program = "from tests.gpsearch.evolution.test_island import *; print(advance(grown(7, 3), BREEDING, 7))"
    texts = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "PYTHONHASHSEED": hash_seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for hash_seed in ("1", "2")
    }
    assert texts == {str(advance(grown(7, 3), BREEDING, 7))}


def test_islands_generations_and_runs_differ():
    island = grown(7, 3)
    broods = [
        advance(island, BREEDING, 7),
        advance(replace(island, number=1), BREEDING, 7),
        advance(replace(island, generation=4), BREEDING, 7),
        advance(island, BREEDING, 8),
    ]
    assert len(set(broods)) == 4


def test_seeds_of_different_purposes_give_different_numbers():
    keys = [(s, i, g, role) for s in (0, 1, 2**40) for i in (0, 1) for g in (0, 1) for role in Role]
    assert len({int(generator(*key).integers(2**62)) for key in keys}) == len(keys)


@pytest.mark.parametrize(("count", "k"), [(10, 1), (10, 3), (16, 8)])
def test_tournament_pressure_is_that_of_theory(count, k):
    """The best of k draws with replacement: rank r wins with ((n - r)^k - (n - r - 1)^k) / n^k."""
    breeding = replace(BREEDING, starts=("p0",), size=4000, tournament=k)
    brood = advance(ranked(count), breeding, 3)[:2000]
    winners = Counter(int(child.genome.edits[0].at.split()[1]) for child in brood)
    ranks = np.arange(count)
    expected = 2000 * ((count - ranks) ** k - (count - ranks - 1.0) ** k) / float(count) ** k
    assert expected[0] / 2000 == pytest.approx(1 - (1 - 1 / count) ** k)
    observed = np.array([winners[rank] for rank in ranks])
    rare = expected < 5
    pooled = [np.append(values[~rare], values[rare].sum()) for values in (observed, expected)]
    pooled = [values[pooled[1] > 0] for values in pooled]
    assert stats.chisquare(*pooled).pvalue > 1e-3


def test_equal_errors_are_ordered_by_size_and_then_by_text():
    genome = Genome("p0")
    best_first = (
        Individual(genome, "p1", 1, 0.5),
        Individual(genome, "p0", 1, 0.6),
        Individual(genome, "p1", 1, 0.6),
        Individual(genome, "sin(p0)", 2, 0.6),
        Individual(genome, "p0", 1, inf),
    )
    assert all(better.rank < worse.rank for better, worse in pairwise(best_first))


def test_survivors_are_the_offspring_with_their_errors():
    brood = advance(Island(3), BREEDING, 1)
    errors = {child.expression: make_believe_error(child.expression) for child in brood}
    island = survive(Island(3), brood, errors)
    assert (island.number, island.generation) == (3, 1)
    assert [(i.genome, i.error) for i in island.population] == [(c.genome, errors[c.expression]) for c in brood]


@pytest.mark.parametrize("migrants", [1, 2, 5])
def test_the_best_of_every_island_replace_the_worst_of_the_next_in_the_ring(migrants):
    islands = [grown(7, 2, number=number) for number in range(4)]
    moved = migrate(islands, migrants)
    for position, island in enumerate(moved):
        before = sorted(islands[position].population, key=lambda i: i.rank)
        arrived = sorted(islands[(position + 3) % 4].population, key=lambda i: i.rank)[:migrants]
        stayed = before[: len(before) - migrants]
        assert (island.number, island.generation) == (position, 2)
        assert Counter(island.population) == Counter([*stayed, *arrived])


def test_nothing_migrates_from_one_island_or_of_none():
    islands = [grown(7, 2, number=number) for number in range(2)]
    assert migrate(islands[:1], 2) == (islands[0],)
    assert migrate(islands, 0) == tuple(islands)
