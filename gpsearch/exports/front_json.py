"""front.json, version 1: the front and the baselines of a run. Its JSON Schema is `front.schema.json`."""

import hashlib
import json
import math
from dataclasses import dataclass
from importlib import resources
from typing import Any, TypeVar

from fitters import expressions
from fitters.culling import Step
from fitters.expressions.catalogue import formula as published_formula
from fitters.fits import Description
from fitters.fits.problem import CHANNELS
from gpsearch import __version__
from gpsearch.configuration import Configuration
from gpsearch.front import Baseline, FormulaBaseline, Member, Store, TabulatedBaseline

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
    scene, baselines = configuration.scene, store.baselines()
    return {
        "schema": SCHEMA,
        "run": {
            "name": configuration.name,
            "seed": configuration.seed,
            "version": __version__,
            "config_sha256": configuration.sha256,
            "materials": list(materials),
            "scene": scene.model_dump(),
            "metric": configuration.metric,
            "generations": generations,
            "candidates": candidates,
            "seconds": round(store.seconds, 3),
        },
        "front": [_member_entry(formula, materials) for formula in _non_dominated(_formulas(store))],
        "baselines": [
            _baseline_entry(name, baselines[name], configuration.metric, materials)
            for name in dict.fromkeys(configuration.baselines)
            if name in baselines
        ],
    }


@dataclass(frozen=True)
class _Formula:
    """A front member, or what culling has left of it: then `before` and `steps` say of what, and how."""

    member: Member
    expression: str
    nodes: int
    description: Description
    before: Description | None = None
    steps: tuple[Step, ...] = ()


def _formulas(store: Store) -> list[_Formula]:
    """The members that are described; of those that were culled, what is left."""
    described, culled = store.descriptions(), store.culled()
    found = []
    for member in store.front().members:
        if (before := described.get(member.expression)) is None:
            continue
        left = culled.get(member.expression)
        if left is None or left.description is None:
            found.append(_Formula(member, member.expression, member.nodes, before))
        else:
            nodes = expressions.parse(left.expression).nodes
            found.append(_Formula(member, left.expression, nodes, left.description, before, left.steps))
    return found


def _non_dominated(formulas: list[_Formula]) -> list[_Formula]:
    """Formulas by size with falling exact error: polish and culling may have changed who beats whom."""
    kept: list[_Formula] = []
    for formula in sorted(formulas, key=lambda f: (f.nodes, f.description.fit.error, f.expression)):
        if formula.description.fit.error < (kept[-1].description.fit.error if kept else math.inf):
            kept.append(formula)
    return kept


def _member_entry(formula: _Formula, materials: tuple[str, ...]) -> dict[str, Any]:
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
        "metrics": _finite(description.metrics),
        "cost_ns": round(description.cost_ns, 3),
        "start": member.genome.start,
        "genome": member.genome.to_json(),
        "origin": {"island": member.island, "generation": member.generation},
        "checks": _finite(
            {
                "reciprocity": checks.reciprocity,
                "minimum": checks.minimum,
                "albedo_max": checks.albedo_max,
            }
        ),
        "warnings": list(description.warnings),
    } | _culled_entry(formula)


def _culled_entry(formula: _Formula) -> dict[str, Any]:
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


def _baseline_entry(name: str, baseline: Baseline, metric: str, materials: tuple[str, ...]) -> dict[str, Any]:
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
        "error": _finite_or_none(fit.error),
        "errors": _by_material([_finite_or_none(error) for error in fit.errors.tolist()], materials),
        "metrics": _finite(description.metrics),
        "cost_ns": round(description.cost_ns, 3),
        "warnings": list(description.warnings),
    }


def _tabulated_entry(baseline: TabulatedBaseline, metric: str, materials: tuple[str, ...]) -> dict[str, Any]:
    metrics = _finite(baseline.metrics)
    return {
        "kind": baseline.kind,
        "floats": baseline.floats,
        "error": metrics[metric],
        "errors": _by_material([_finite_or_none(error) for error in baseline.errors[metric]], materials),
        "metrics": metrics,
        "cost_ns": round(baseline.cost_ns, 3),
        "warnings": list(baseline.warnings),
    }


def _by_material(values: list[T], materials: tuple[str, ...]) -> dict[str, list[T]]:
    """Values of all targets as one list of channels per material."""
    return {name: values[3 * i : 3 * i + 3] for i, name in enumerate(materials)}


def _finite(numbers: dict[str, float]) -> dict[str, float | None]:
    return {name: _finite_or_none(value) for name, value in numbers.items()}


def _finite_or_none(value: float) -> float | None:
    """JSON has no infinity: what is not finite becomes null."""
    return value if math.isfinite(value) else None


def to_text(exported: dict[str, Any]) -> str:
    """An export as the text of a file; the same export gives the same text."""
    return json.dumps(exported, indent=1, allow_nan=False) + "\n"
