"""The expressions that enter a generation of an island: of every canonical form one."""

from collections.abc import Iterable
from dataclasses import dataclass

from fitters.expressions import parse
from fitters.expressions.canonical import Canonical, canonical
from fitters.fitting import Confirmed
from gpsearch.evolution.island import Island, Offspring
from gpsearch.genomes import Genome
from gpsearch.run import Member


@dataclass(frozen=True)
class Entrant:
    """An expression of a generation, its size, canonical form and parent, and the genome that it came from."""

    expression: str
    nodes: int
    canonical: Canonical
    parent: str
    genome: Genome
    island: int
    generation: int

    @classmethod
    def of(cls, child: Offspring, island: Island) -> "Entrant":
        return cls(
            child.expression,
            child.nodes,
            child.canonical,
            child.parent,
            child.genome,
            island.number,
            island.generation + 1,
        )

    @classmethod
    def of_start(cls, start: str) -> "Entrant":
        expression = parse(start)
        return cls(start, expression.nodes, canonical(expression), start, Genome(start), 0, 0)

    def member(self, confirmed: Confirmed, screened: float) -> Member:
        return Member(
            expression=self.expression,
            nodes=self.nodes,
            genome=self.genome,
            island=self.island,
            generation=self.generation,
            fit=confirmed.fit,
            screened=screened,
        )


def entrants(island: Island, brood: Iterable[Offspring], starts: Iterable[str]) -> dict[str, Entrant]:
    """The smallest expression of every canonical form that occurs, the first of equals, by that form."""
    every = [Entrant.of_start(start) for start in starts]
    every += [Entrant.of(child, island) for child in brood]
    found: dict[str, Entrant] = {}
    for entrant in every:
        before = found.get(entrant.canonical.text)
        if before is None or entrant.nodes < before.nodes:
            found[entrant.canonical.text] = entrant
    return found
