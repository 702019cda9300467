"""Models of a run refitted to materials that it was not searched on: in this process, kept in the disk cache."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fitters.fitting import Problem, transfer
from fitters.models import MaterialTask, summarise
from gpsearch.configuration import Configuration
from gpsearch.exports.front_json import baseline_entry
from gpsearch.exports.transfers import transfer_entry
from gpsearch.judging.materials import NamedMaterial
from gpsearch.run import FormulaBaseline, Transfer
from gpsearch.search.plan import Plan, plan, problem_recipe

REFERENCES = ("cook-torrance", "ggx")
"""What every formula is compared with; the genBRDF paper has the first."""

Transfers = Mapping[tuple[str, str], Transfer]
"""By model, as `model_of` names it, and by material's name."""


def entries_of(exported: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The entries of an export: the front, then the baselines."""
    return [*exported["front"], *exported["baselines"]]


def model_of(entry: Mapping[str, Any]) -> str:
    """The name of a baseline, or the expression of what was found."""
    return entry["name"] if "name" in entry else entry["expression"]


def with_references(exported: dict[str, Any], configuration: Configuration) -> dict[str, Any]:
    """The export with `REFERENCES` among its baselines, as if the run had them."""
    missing = set(REFERENCES) - {entry["name"] for entry in exported["baselines"]}
    if not missing:
        return exported
    problem, planned = problem_recipe(configuration).build(), plan(configuration)
    added = []
    for name in (name for name in REFERENCES if name in missing):
        found = FormulaBaseline(transfer(problem, planned.formula_job(name)), 0.0)
        added.append(baseline_entry(name, found, configuration.metric, configuration.material_names))
    return exported | {"baselines": [*exported["baselines"], *added]}


def transfers(
    entries: Sequence[Mapping[str, Any]], materials: Sequence[NamedMaterial], configuration: Configuration
) -> Iterator[tuple[tuple[str, str], Transfer]]:
    """The fits of entries to materials, one problem after the other."""
    recipe, planned = problem_recipe(configuration), plan(configuration)
    for material in materials:
        problem = recipe.of(material.reference).build()
        for entry in entries:
            yield (model_of(entry), material.name), _transfer(entry, problem, planned)


def _transfer(entry: Mapping[str, Any], problem: Problem, planned: Plan) -> Transfer:
    if "expression" not in entry:
        return Transfer.of_table(summarise(problem, MaterialTask(entry["name"], 0)), planned.metric)
    job = planned.formula_job(entry["name"]) if "name" in entry else planned.job(entry["expression"])
    return Transfer.of_formula(transfer(problem, job))


def with_tests(
    exported: dict[str, Any], found: Transfers, materials: Sequence[NamedMaterial], metric: str
) -> dict[str, Any]:
    """The export as if these were the test materials of the run; what nothing was found of keeps its `test`."""

    def tested(entry: dict[str, Any]) -> dict[str, Any]:
        model = model_of(entry)
        if not any(known == model for known, _ in found):
            return entry
        by_name = {one.name: found.get((model, one.name)) for one in materials}
        return entry | transfer_entry(
            by_name, metric, tuple(entry["parameters"]) if "parameters" in entry else None
        )

    return exported | {
        "run": exported["run"] | {"test_materials": [one.name for one in materials]},
        "front": [tested(entry) for entry in exported["front"]],
        "baselines": [tested(entry) for entry in exported["baselines"]],
    }
