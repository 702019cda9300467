"""Islands: populations that breed separately, after section 3.2 of the genBRDF paper.

All functions here are pure: no clock, no global random numbers, no input or output.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np

from fitters.expressions import parse, to_text
from fitters.expressions.canonical import Canonical, canonical
from gpsearch.genomes import Genome, Mutation, crossover, random_edit
from gpsearch.genomes.edits import Draft
from gpsearch.genomes.genome import draft


class Role(IntEnum):
    """The use of random numbers. A value never changes and is never reused: it decides what a seed gives."""

    FOUNDERS = 0
    CHILDREN = 1
    CELLS = 2


def generator(run_seed: int, island: int, generation: int, role: Role) -> np.random.Generator:
    """The random numbers of one role in one generation of one island.

    Seeds are derived, not drawn: the same arguments give the same numbers anywhere.
    """
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence((run_seed, island, generation, int(role)))))


def cells_seed(run_seed: int) -> int:
    """The seed of the sample of cells, one for a whole run."""
    return int(generator(run_seed, 0, 0, Role.CELLS).integers(2**31))


@dataclass(frozen=True)
class Breeding:
    """The settings of breeding.

    starts:     starting expressions in text form
    size:       individuals per island, even
    tournament: number of random individuals of which the best becomes a parent
    """

    starts: tuple[str, ...]
    size: int
    tournament: int
    mutation: Mutation


@dataclass(frozen=True, slots=True)
class Offspring:
    """A genome that is not fitted yet.

    expression: in text form
    parent:     expression of the genome that it was made from
    canonical:  canonical form of `expression`; candidates of the same form share a fit
    """

    genome: Genome
    expression: str
    nodes: int
    parent: str
    canonical: Canonical

    @classmethod
    def of_start(cls, start: str) -> "Offspring":
        """A starting expression as it is, without edits."""
        expression = parse(start)
        return cls(Genome(start), start, expression.nodes, start, canonical(expression))


@dataclass(frozen=True, slots=True)
class Individual:
    """A genome with the error of its expression, infinite where that has no finite fit."""

    genome: Genome
    expression: str
    nodes: int
    error: float

    @property
    def rank(self) -> tuple[float, int, str]:
        """Better individuals sort first: by error, then size, then text, so that the order is unique."""
        return (self.error, self.nodes, self.expression)


@dataclass(frozen=True)
class Island:
    """A population and the number of its generation; generation 0 has no population."""

    number: int
    generation: int = 0
    population: tuple[Individual, ...] = ()

    def quantile(self, share: float) -> float:
        """The error that this share of the population does not exceed. The population must not be empty."""
        return self._errors[int(share * (len(self._errors) - 1))]

    @cached_property
    def _errors(self) -> tuple[float, ...]:
        """Sorted once, because `quantile` is called for every candidate."""
        return tuple(sorted(individual.error for individual in self.population))


def advance(island: Island, breeding: Breeding, run_seed: int) -> tuple[Offspring, ...]:
    """The offspring that become the next generation once they are fitted: founders, or children of the population.

    Tournaments choose half as many parents as there are individuals, which are paired at random. One-point
    crossover makes as many children. Then parents and children each get one more random edit.
    """
    if not island.population:
        return _founders(island, breeding, generator(run_seed, island.number, 0, Role.FOUNDERS))
    rng = generator(run_seed, island.number, island.generation, Role.CHILDREN)
    parents = [_tournament(island.population, breeding.tournament, rng) for _ in range(breeding.size // 2)]
    paired = [parents[i] for i in rng.permutation(len(parents))]
    children: list[Genome] = []
    for first, second in zip(paired[::2], [*paired[1::2], paired[0]], strict=False):
        cut = int(rng.integers(1, len(first.genome.edits))) if len(first.genome.edits) > 1 else 0
        children += crossover(first.genome, second.genome, cut)
    # The first edits of a pair's first child are from the first parent, those of the second from the second.
    bred = [(parent.genome, parent) for parent in parents] + list(zip(children, paired, strict=False))
    return tuple(_child(genome, parent, breeding, rng) for genome, parent in bred)


def survive(island: Island, offspring: Sequence[Offspring], errors: Mapping[str, float]) -> Island:
    """The island whose population is the offspring, with the errors of their fits by expression."""
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
    """Genomes of one random edit, each starting expression equally often."""
    starts = [breeding.starts[i % len(breeding.starts)] for i in range(breeding.size)]
    return tuple(_offspring(Genome(start), draft(Genome(start)), start, breeding, rng) for start in starts)


def _tournament(population: Sequence[Individual], count: int, rng: np.random.Generator) -> Individual:
    drawn = rng.integers(len(population), size=count)
    return min((population[i] for i in drawn), key=lambda individual: individual.rank)


def _child(genome: Genome, parent: Individual, breeding: Breeding, rng: np.random.Generator) -> Offspring:
    """The genome with one more random edit; of the parent's genome where crossover has exceeded the limits."""
    current = draft(genome)
    if not current.within_limits(breeding.mutation.max_nodes):
        genome, current = parent.genome, draft(parent.genome)
    return _offspring(genome, current, parent.expression, breeding, rng)


def _offspring(
    genome: Genome, current: Draft, parent: str, breeding: Breeding, rng: np.random.Generator
) -> Offspring:
    """The genome with one more random edit, which keeps the expression within its limits."""
    edit = random_edit(current, breeding.mutation, rng)
    current.apply(edit)
    expression = current.expression()
    return Offspring(genome.with_edit(edit), to_text(expression), expression.nodes, parent, canonical(expression))
