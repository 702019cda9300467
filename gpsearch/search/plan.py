"""A configuration turned into what the search and its workers take."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import ceil

from fitters.expressions import to_text
from fitters.fitting import Candidate, Fit, FitJob, FitSettings, Problem, ProblemRecipe, screen
from fitters.models.formula import published
from gpsearch.configuration import Configuration
from gpsearch.evolution.island import Breeding, cells_seed
from gpsearch.genomes import Mutation, codebank
from workers import Recipe


@dataclass(frozen=True)
class Budget:
    """When to stop; None is without limit."""

    generations: int | None
    seconds: float | None
    candidates: int | None


@dataclass(frozen=True)
class Plan:
    """All that a search needs to know, in its own terms.

    tests: the fit problem of each test material, by its reference: a process need not hold more than one
    """

    seed: int
    islands: int
    breeding: Breeding
    migrate_every: int
    migrants: int
    recipe: Recipe
    tests: Mapping[str, Recipe]
    metric: str
    materials: int
    bounds: tuple[tuple[str, float, float], ...]
    settings: FitSettings
    early_stopping: bool
    warm_starts: bool
    culling: float
    baselines: tuple[str, ...]
    budget: Budget

    def job(self, *expressions: str) -> FitJob:
        """The fit of expressions: every parameter has the search's bounds."""
        return FitJob(expressions, self.bounds, self.settings)

    @property
    def screen(self) -> Callable[[Problem, Candidate], Fit]:
        """The screening of a candidate, likewise."""
        return partial(screen, bounds=self.bounds, settings=self.settings)

    @property
    def last_generation(self) -> int | None:
        """The generation after which the budget of generations or candidates is used up."""
        limits = [self.budget.generations]
        if self.budget.candidates is not None:
            limits.append(ceil(self.budget.candidates / (self.islands * self.breeding.size)))
        return min((limit for limit in limits if limit is not None), default=None)

    def formula_job(self, name: str) -> FitJob:
        """The fit of a catalogue formula within its own bounds."""
        return published(name).job(self.settings)


def budget_of(configuration: Configuration) -> Budget:
    """The budget of a configuration."""
    budget = configuration.budget
    seconds = None if budget.minutes is None else 60.0 * budget.minutes
    return Budget(budget.generations, seconds, budget.candidates)


def plan(configuration: Configuration) -> Plan:
    """The plan of a configuration."""
    search, fit = configuration.search, configuration.fit
    mutation = Mutation(
        codebank=codebank(search.codebank_expressions(), search.parameters),
        max_nodes=search.max_nodes,
        parameters=search.parameters,
        frequencies=(search.edits.swap, search.edits.insert, search.edits.replace, search.edits.delete),
    )
    low, high = search.bounds
    recipe = problem_recipe(configuration)
    return Plan(
        seed=configuration.seed,
        islands=search.islands,
        breeding=Breeding(
            starts=tuple(to_text(expression) for expression in search.start_expressions()),
            size=search.island_size,
            tournament=search.tournament,
            mutation=mutation,
        ),
        migrate_every=search.migrate_every,
        migrants=search.migrants,
        recipe=Recipe(ProblemRecipe.build, recipe),
        tests={name: Recipe(ProblemRecipe.build, recipe.of(name)) for name in configuration.test_materials},
        metric=configuration.metric,
        materials=len(configuration.materials),
        bounds=tuple((f"p{i}", low, high) for i in range(search.parameters)),
        settings=fit.settings,
        early_stopping=fit.early_stopping,
        warm_starts=fit.warm_starts,
        culling=configuration.culling,
        baselines=configuration.baselines,
        budget=budget_of(configuration),
    )


def problem_recipe(configuration: Configuration) -> ProblemRecipe:
    """What every process builds the fit problem from."""
    return ProblemRecipe(
        materials=configuration.materials,
        scene=configuration.scene.recipe,
        metric=configuration.metric,
        cells=configuration.fit.cells,
        confirm_cells=configuration.fit.confirm_cells,
        seed=cells_seed(configuration.seed),
        folder=str(configuration.folder.resolve()),
    )
