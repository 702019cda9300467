"""Islands: sub-populations that breed among themselves, after section 3.2 of the genBRDF paper.

All functions here are pure: no clock, no global randomness, no input or output.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fitters.expressions import to_text
from fitters.expressions.canonical import Canonical, canonical
from gpsearch.evolution.seeds import Role, generator
from gpsearch.genomes import Genome, Mutation, crossover, random_edit
from gpsearch.genomes.edits import Draft
from gpsearch.genomes.genome import draft


@dataclass(frozen=True)
class Breeding:
    """The numbers of the search.

    starts:     starting expressions in text form
    size:       individuals per island, even
    tournament: of so many random individuals the best becomes a parent
    """

    starts: tuple[str, ...]
    size: int
    tournament: int
    mutation: Mutation


@dataclass(frozen=True, slots=True)
class Offspring:
    """A genome that has not been fitted yet, its expression in text form, and that of the genome it came from.

    canonical is the canonical form of the expression, by which fits are remembered.
    """

    genome: Genome
    expression: str
    nodes: int
    parent: str
    canonical: Canonical


@dataclass(frozen=True, slots=True)
class Individual:
    """A genome with the error of its expression, infinite where no fit is finite."""

    genome: Genome
    expression: str
    nodes: int
    error: float

    @property
    def rank(self) -> tuple[float, int, str]:
        """What is better sorts first: smaller error, then size; the text only makes the order total."""
        return (self.error, self.nodes, self.expression)


@dataclass(frozen=True)
class Island:
    """A population and how many generations it has lived; generation 0 has no population yet."""

    number: int
    generation: int = 0
    population: tuple[Individual, ...] = ()

    def quantile(self, share: float) -> float:
        """The error that this share of a population, not empty, does not exceed."""
        return self._errors[int(share * (len(self._errors) - 1))]

    @cached_property
    def _errors(self) -> tuple[float, ...]:
        """By rising error; asked for once per candidate."""
        return tuple(sorted(individual.error for individual in self.population))


def advance(island: Island, breeding: Breeding, run_seed: int) -> tuple[Offspring, ...]:
    """The next generation, not fitted: founders with one random edit each, or the children of this one.

    Half as many parents as there are individuals are chosen by tournament and paired at random; one-point
    crossover makes as many offspring; then parents and offspring each get one more random edit.
    """
    if not island.population:
        return _founders(island, breeding, generator(run_seed, island.number, 0, Role.FOUND))
    rng = generator(run_seed, island.number, island.generation, Role.ADVANCE)
    parents = [_tournament(island.population, breeding.tournament, rng) for _ in range(breeding.size // 2)]
    paired = [parents[i] for i in rng.permutation(len(parents))]
    children: list[Genome] = []
    for first, second in zip(paired[::2], [*paired[1::2], paired[0]], strict=False):
        cut = int(rng.integers(1, len(first.genome.edits))) if len(first.genome.edits) > 1 else 0
        children += crossover(first.genome, second.genome, cut)
    # The first of a pair of children begins as the first parent does, the second as the second.
    bred = [(parent.genome, parent) for parent in parents] + list(zip(children, paired, strict=False))
    return tuple(_mutated(genome, parent, breeding, rng) for genome, parent in bred)


def survive(island: Island, offspring: Sequence[Offspring], errors: Mapping[str, float]) -> Island:
    """The island whose population is the offspring, with the errors (by expression) that fits have found."""
    population = tuple(
        Individual(child.genome, child.expression, child.nodes, errors[child.expression]) for child in offspring
    )
    return Island(island.number, island.generation + 1, population)


def migrate(islands: Sequence[Island], migrants: int) -> tuple[Island, ...]:
    """Every island's best `migrants` replace the worst of the next island in the ring (section 3.2, step 5)."""
    if len(islands) < 2 or not migrants:
        return tuple(islands)
    best = [sorted(island.population, key=lambda i: i.rank)[:migrants] for island in islands]
    moved = []
    for position, island in enumerate(islands):
        stay = sorted(island.population, key=lambda i: i.rank)[: len(island.population) - migrants]
        moved.append(Island(island.number, island.generation, (*stay, *best[position - 1])))
    return tuple(moved)


def _founders(island: Island, breeding: Breeding, rng: np.random.Generator) -> tuple[Offspring, ...]:
    """Genomes of one edit; the starts take turns."""
    starts = [breeding.starts[i % len(breeding.starts)] for i in range(breeding.size)]
    return tuple(_edited(Genome(start), draft(Genome(start)), start, breeding, rng) for start in starts)


def _tournament(population: Sequence[Individual], count: int, rng: np.random.Generator) -> Individual:
    drawn = rng.integers(len(population), size=count)
    return min((population[i] for i in drawn), key=lambda individual: individual.rank)


def _mutated(genome: Genome, parent: Individual, breeding: Breeding, rng: np.random.Generator) -> Offspring:
    """The genome with one more edit, or the parent's, where crossover made it larger or deeper than is allowed."""
    grown = draft(genome)
    if not grown.fits(breeding.mutation.max_nodes):
        genome, grown = parent.genome, draft(parent.genome)
    return _edited(genome, grown, parent.expression, breeding, rng)


def _edited(genome: Genome, grown: Draft, parent: str, breeding: Breeding, rng: np.random.Generator) -> Offspring:
    """The genome with one more random edit. A root that became a vector or grew too large cannot come of it."""
    edit = random_edit(grown, breeding.mutation, rng)
    grown.apply(edit)
    expression = grown.expression()
    return Offspring(genome.with_edit(edit), to_text(expression), expression.nodes, parent, canonical(expression))
