"""Models of a run refitted to materials that it was not searched on: in this process, kept in the disk cache."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from fitters.fitting import Problem, transfer
from fitters.models import MaterialTask, summarise
from gpsearch.configuration import Configuration
from gpsearch.judging.materials import NamedMaterial
from gpsearch.run import Baseline, FormulaBaseline, FoundFormula, Result, Transfer
from gpsearch.run.loading import baseline_entry, fit_on_tests
from gpsearch.run.result import FOUND
from gpsearch.search.plan import Plan, plan, problem_recipe

REFERENCES = ("cook-torrance", "ggx")
"""What every formula is compared with; the genBRDF paper has the first."""

E = TypeVar("E", FoundFormula, Baseline)
Transfers = Mapping[tuple[str, str], Transfer]
"""By model, as `stored_name` names it, and by material's name."""


def stored_name(entry: FoundFormula | Baseline) -> str:
    """What stores call a model: the name of a baseline, or the expression of what was found."""
    return entry.expression if isinstance(entry, FoundFormula) else entry.name


def with_references(result: Result, configuration: Configuration) -> Result:
    """The result with `REFERENCES` among its baselines, as if the run had them."""
    missing = [name for name in REFERENCES if name not in {baseline.name for baseline in result.baselines}]
    if not missing:
        return result
    problem, planned = problem_recipe(configuration).build(), plan(configuration)
    added = []
    for name in missing:
        baseline = FormulaBaseline(transfer(problem, planned.formula_job(name)), 0.0)
        added.append(baseline_entry(name, baseline, configuration.metric, configuration.material_names))
    return replace(result, baselines=(*result.baselines, *added))


def transfers(
    entries: Sequence[FoundFormula | Baseline], materials: Sequence[NamedMaterial], configuration: Configuration
) -> Iterator[tuple[tuple[str, str], Transfer]]:
    """The fits of entries to materials, one problem after the other."""
    recipe, planned = problem_recipe(configuration), plan(configuration)
    for material in materials:
        problem = recipe.of(material.reference).build()
        for entry in entries:
            yield (stored_name(entry), material.name), _transfer(entry, problem, planned)


def _transfer(entry: FoundFormula | Baseline, problem: Problem, planned: Plan) -> Transfer:
    if entry.expression is None:
        return Transfer.of_table(summarise(problem, MaterialTask(entry.name, 0)), planned.metric)
    job = planned.job(entry.expression) if entry.kind == FOUND else planned.formula_job(entry.name)
    return Transfer.of_formula(transfer(problem, job))


def with_tests(result: Result, fits: Transfers, materials: Sequence[NamedMaterial]) -> Result:
    """The result as if these were the test materials of the run; an entry without such fits keeps its own."""
    refitted = {model for model, _ in fits}

    def tested(entry: E) -> E:
        name = stored_name(entry)
        if name not in refitted:
            return entry
        by_material = {one.name: fits.get((name, one.name)) for one in materials}
        return replace(entry, test=fit_on_tests(by_material, result.run.metric, entry.parameters))

    return replace(
        result,
        run=replace(result.run, test_materials=tuple(one.name for one in materials)),
        formulas=tuple(map(tested, result.formulas)),
        baselines=tuple(map(tested, result.baselines)),
    )
