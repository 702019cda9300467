"""front.json, version 1: the front and the baselines of a run. Its JSON Schema is `front.schema.json`."""

import hashlib
import json
from importlib import resources
from typing import Any, TypeVar

from fitters import expressions
from fitters.expressions.catalogue import formula as published_formula
from fitters.fitting import Description
from fitters.grid import CHANNELS
from gpsearch import __version__
from gpsearch.configuration import Configuration
from gpsearch.exports.numbers import finite, finite_or_none
from gpsearch.exports.transfers import transfer_entry
from gpsearch.run import Baseline, FormulaBaseline, ListedFormula, Store, TabulatedBaseline, listed_formulas

SCHEMA = "gpsearch-front/1"

T = TypeVar("T")


def schema() -> dict[str, Any]:
    """The JSON Schema that every export fulfils."""
    return json.loads(resources.files(__package__).joinpath("front.schema.json").read_text())


def front_json(store: Store, configuration: Configuration) -> dict[str, Any]:
    """The front of a run as plain objects, sorted by size, the error strictly falling.

    Only members that are described count: `Search.describe_front` describes them all. What culling has left of
    a member stands in its place.
    """
    materials = configuration.material_names
    generations, candidates, _ = store.totals()
    scene, baselines, transfers = configuration.scene, store.baselines(), store.transfers()
    tests = dict(zip(configuration.test_material_names, configuration.test_materials, strict=True))

    def tested(model: str, symbols: tuple[str, ...] | None) -> dict[str, Any]:
        found = {name: transfers.get((model, reference)) for name, reference in tests.items()}
        return transfer_entry(found, configuration.metric, symbols)

    return {
        "schema": SCHEMA,
        "run": {
            "name": configuration.name,
            "seed": configuration.seed,
            "version": __version__,
            "config_sha256": configuration.sha256,
            "materials": list(materials),
            **({"test_materials": list(tests)} if tests else {}),
            "scene": scene.model_dump(),
            **_light(store),
            "metric": configuration.metric,
            "generations": generations,
            "candidates": candidates,
            "seconds": round(store.seconds, 3),
        },
        "front": [
            _member_entry(formula, materials) | tested(formula.expression, formula.description.fit.names)
            for formula in listed_formulas(store)
        ],
        "baselines": [
            baseline_entry(name, baselines[name], configuration.metric, materials)
            | tested(name, _symbols(baselines[name]))
            for name in dict.fromkeys(configuration.baselines)
            if name in baselines
        ],
    }


def _symbols(baseline: Baseline) -> tuple[str, ...] | None:
    """The parameters of a published formula; None for what is no formula."""
    return baseline.description.fit.names if isinstance(baseline, FormulaBaseline) else None


def _light(store: Store) -> dict[str, Any]:
    """How far the light table is from its limit; nothing for runs of versions that did not ask."""
    distance = store.meta("light_distance")
    return {} if distance is None else {"light_distance": float(distance)}


def _member_entry(formula: ListedFormula, materials: tuple[str, ...]) -> dict[str, Any]:
    member, description = formula.member, formula.description
    fit, checks = description.fit, description.checks
    return {
        "id": hashlib.sha256(formula.expression.encode()).hexdigest()[:8],
        "expression": formula.expression,
        "nodes": formula.nodes,
        "parameters": {
            name: _by_material(fit.values[:, column].tolist(), materials) for column, name in enumerate(fit.names)
        },
        "error": fit.error,
        "errors": _by_material(fit.errors.tolist(), materials),
        "metrics": finite(description.metrics),
        "cost_ns": round(description.cost_ns, 3),
        "start": member.genome.start,
        "genome": member.genome.to_json(),
        "origin": {"island": member.island, "generation": member.generation},
        "checks": finite(
            {
                "reciprocity": checks.reciprocity,
                "minimum": checks.minimum,
                "albedo_max": checks.albedo_max,
            }
        ),
        "warnings": list(description.warnings),
    } | _culled_entry(formula)


def _culled_entry(formula: ListedFormula) -> dict[str, Any]:
    """What went and what it cost; nothing for a formula that is as the search found it."""
    if formula.before is None:
        return {}
    return {
        "culled": {
            "from": formula.member.expression,
            "nodes": formula.member.nodes,
            "error": formula.before.fit.error,
            "steps": [
                vars(step) | {"nodes": list(step.nodes), "error": list(step.error)} for step in formula.steps
            ],
        }
    }


def baseline_entry(name: str, baseline: Baseline, metric: str, materials: tuple[str, ...]) -> dict[str, Any]:
    """A baseline as an export has it, but for its `test`."""
    if isinstance(baseline, FormulaBaseline):
        entry = _formula_entry(name, baseline.description, materials)
    else:
        entry = _tabulated_entry(baseline, metric, materials)
    return {"name": name, **entry, "fit_seconds": round(baseline.fit_seconds, 3)}


def _formula_entry(name: str, description: Description, materials: tuple[str, ...]) -> dict[str, Any]:
    fit = description.fit
    published = published_formula(name)
    return {
        "kind": "formula",
        "expression": expressions.to_text(published.expression),
        "nodes": published.expression.nodes,
        "floats": len(fit.names) * len(CHANNELS),
        "parameters": {
            symbol: _by_material(fit.values[:, column].tolist(), materials)
            for column, symbol in enumerate(fit.names)
        },
        "error": finite_or_none(fit.error),
        "errors": _by_material([finite_or_none(error) for error in fit.errors.tolist()], materials),
        "metrics": finite(description.metrics),
        "cost_ns": round(description.cost_ns, 3),
        "warnings": list(description.warnings),
    }


def _tabulated_entry(baseline: TabulatedBaseline, metric: str, materials: tuple[str, ...]) -> dict[str, Any]:
    metrics = finite(baseline.metrics)
    return {
        "kind": baseline.kind,
        "floats": baseline.floats,
        "error": metrics[metric],
        "errors": _by_material([finite_or_none(error) for error in baseline.errors[metric]], materials),
        "metrics": metrics,
        "cost_ns": round(baseline.cost_ns, 3),
        "warnings": list(baseline.warnings),
    }


def _by_material(values: list[T], materials: tuple[str, ...]) -> dict[str, list[T]]:
    """Values of all targets as one list of channels per material."""
    return {name: values[3 * i : 3 * i + 3] for i, name in enumerate(materials)}


def to_text(exported: dict[str, Any]) -> str:
    """An export as the text of a file; the same export gives the same text."""
    return json.dumps(exported, indent=1, allow_nan=False) + "\n"
