"""Searches that benchmarks run: the paper's settings on the benchmarks' problem."""

from fitters.expressions import to_text
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import FitSettings, ProblemRecipe
from gpsearch.evolution.island import Breeding
from gpsearch.genomes import Mutation, codebank
from gpsearch.search.plan import Budget, Plan
from tests.benchmarks.candidates import PARAMETERS, WIDE
from tests.benchmarks.problem import SEED
from workers import Recipe


def plan(recipe: ProblemRecipe, *, islands: int, size: int, generations: int, early_stopping: bool) -> Plan:
    """Section 4 of the genBRDF paper but for the sizes: from Cook-Torrance, four parameters, 120 nodes at most."""
    formulas = [formula.expression for formula in CATALOGUE.values()]
    usable = [f for f in formulas if all(int(name[1:]) < PARAMETERS for name in f.parameters)]
    mutation = Mutation(codebank=codebank(usable, PARAMETERS), max_nodes=120, parameters=PARAMETERS)
    starts = (to_text(CATALOGUE["cook-torrance"].expression),)
    return Plan(
        seed=SEED,
        islands=islands,
        breeding=Breeding(starts=starts, size=size, tournament=8, mutation=mutation),
        migrate_every=5,
        migrants=1,
        recipe=Recipe(ProblemRecipe.build, recipe),
        tests={},
        metric=recipe.metric,
        materials=len(recipe.materials),
        bounds=tuple((f"p{i}", *WIDE) for i in range(PARAMETERS)),
        settings=FitSettings(),
        early_stopping=early_stopping,
        warm_starts=True,
        culling=0.0,
        baselines=(),
        budget=Budget(generations=generations, seconds=None, candidates=None),
    )


class Silent:
    """A watcher that says nothing."""

    def stage(self, name: str, total: int | None) -> None: ...

    def step(self, count: int) -> None: ...

    def generation(self, status: object) -> None: ...

    def incident(self, incident: object) -> None: ...
