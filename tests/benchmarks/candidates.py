"""What benchmarks fit: the catalogue's formulas, and random candidates as a search breeds them."""

from dataclasses import dataclass

import numpy as np

from fitters.expressions import Expression, parse, to_text
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting.settings import Bounds
from gpsearch.evolution.island import Breeding, Island, advance
from gpsearch.genomes import Mutation, codebank, random_edit, reify
from gpsearch.genomes.genome import draft
from tests.benchmarks.problem import SEED

PARAMETERS = 4
WIDE = (1e-6, 1e5)
"""Of every parameter of a random candidate: a search's default."""

EDITS = (3, 6)
"""The fewest and the most edits of a random candidate."""


@dataclass(frozen=True)
class Candidate:
    """A formula to fit: `name` is the catalogue's, or `random 1`.. for what was bred."""

    name: str
    expression: Expression
    bounds: Bounds


def catalogue() -> tuple[Candidate, ...]:
    """The published formulas within their own bounds."""
    return tuple(Candidate(name, formula.expression, formula.bounds) for name, formula in CATALOGUE.items())


def random_candidates(count: int) -> tuple[Candidate, ...]:
    """`count` different children of Cook-Torrance and GGX, of three to six edits each; always the same ones."""
    mutation = Mutation(
        codebank=codebank((formula.expression for formula in CATALOGUE.values()), PARAMETERS),
        max_nodes=90,
        parameters=PARAMETERS,
    )
    starts = tuple(to_text(CATALOGUE[name].expression) for name in ("cook-torrance", "ggx"))
    breeding = Breeding(starts=starts, size=2 * count, tournament=8, mutation=mutation)
    rng = np.random.default_rng(SEED)
    texts: dict[str, None] = {}
    for founder in advance(Island(0), breeding, SEED):
        genome = founder.genome
        for _ in range(int(rng.integers(EDITS[0], EDITS[1] + 1)) - len(genome.edits)):
            genome = genome.with_edit(random_edit(draft(genome), mutation, rng))
        expression = reify(genome)
        if expression.parameters:
            texts[to_text(expression)] = None
    bounds = {f"p{i}": WIDE for i in range(PARAMETERS)}
    return tuple(
        Candidate(f"random {i}", parse(text), bounds) for i, text in enumerate(list(texts)[:count], start=1)
    )
