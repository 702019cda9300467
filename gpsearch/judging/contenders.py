"""Everything that competes in a run: members of its front and its baselines, with a model of every material."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fitters.errors import FittersError
from fitters.expressions import parse
from fitters.materials import Material, load_material
from fitters.models import MODELS, FormulaModel, MaterialFitter, Model
from gpsearch.configuration import Configuration

FOUND = "found"


@dataclass(frozen=True, eq=False)
class Contender:
    """A model as users meet it.

    name:        a baseline's name, or the id of a front member
    kind:        `found`, `formula` (published), `factors`, `table` or `power-iterations`
    expression:  of a formula, as is `nodes`
    floats:      numbers stored per material, all three channels
    error:       in the run, by its metric; None where it could not be fitted
    test_error:  the same on test materials; None, too, where there are none
    fit_seconds: of all materials; None where nobody measured it
    models:      by material's name; what could not be fitted is not there, and a warning says why
    errors:      of each channel by the run's metric, by material's name; None where one is not finite
    """

    name: str
    kind: str
    expression: str | None
    nodes: int | None
    floats: int
    error: float | None
    fit_seconds: float | None
    warnings: tuple[str, ...]
    models: Mapping[str, Model]
    test_error: float | None = None
    errors: Mapping[str, Sequence[float | None]] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """The name as tables show it: what was found has its size beside it."""
        return f"{self.name} ({self.nodes} nodes)" if self.kind == FOUND else self.name


def materials_of(configuration: Configuration) -> tuple[Material, ...]:
    """The materials of a run, loaded. Raises `FittersError` where one is no longer there."""
    return tuple(load_material(reference, base=configuration.folder) for reference in configuration.materials)


def contenders(exported: Mapping[str, Any], materials: Sequence[Material]) -> list[Contender]:
    """What an exported front (`gpsearch.exports.front_json`) holds, in its order: the front, then the baselines.

    `materials` are some of the run's, test materials among them. Tables are read from the disk cache, or fitted
    again.
    """
    found = [_formula(entry, entry["id"], FOUND, materials) for entry in exported["front"]]
    return found + [_baseline(entry, materials) for entry in exported["baselines"]]


def joined(one: Contender, other: Contender) -> Contender:
    """The same contender with the models of both, each of other materials."""
    warnings = tuple(dict.fromkeys((*one.warnings, *other.warnings)))
    return replace(one, models={**one.models, **other.models}, warnings=warnings)


def _formula(entry: Mapping[str, Any], name: str, kind: str, materials: Sequence[Material]) -> Contender:
    expression = parse(entry["expression"])
    models: dict[str, Model] = {}
    for material in materials:
        parameters = _parameters(entry, material.name)
        if parameters is not None:
            columns = [parameters[symbol][material.name] for symbol in expression.parameters]
            models[material.name] = FormulaModel(expression, np.array(columns).T.reshape(3, len(columns)))
    return Contender(
        name=name,
        kind=kind,
        expression=entry["expression"],
        nodes=entry["nodes"],
        floats=3 * len(expression.parameters),
        error=entry["error"],
        fit_seconds=entry.get("fit_seconds"),
        warnings=_warnings(entry, materials),
        models=models,
        **_tested(entry),
    )


def _parameters(entry: Mapping[str, Any], material: str) -> Mapping[str, Any] | None:
    """Those of a formula that hold for a material; None for a test material that it could not be fitted to."""
    if material in entry["errors"]:
        return entry["parameters"]
    test = entry["test"]
    return None if None in test["errors"][material] else test["parameters"]


def _baseline(entry: Mapping[str, Any], materials: Sequence[Material]) -> Contender:
    fitter = MODELS[entry["name"]]
    if not isinstance(fitter, MaterialFitter):
        return _formula(entry, entry["name"], "formula", materials)
    models: dict[str, Model] = {}
    for material in materials:
        try:
            models[material.name] = fitter.kept(material).model
        except FittersError:
            continue  # its entry's warnings say why
    return Contender(
        name=entry["name"],
        kind=entry["kind"],
        expression=None,
        nodes=None,
        floats=entry["floats"],
        error=entry["error"],
        fit_seconds=entry["fit_seconds"],
        warnings=_warnings(entry, materials),
        models=models,
        **_tested(entry),
    )


def _tested(entry: Mapping[str, Any]) -> dict[str, Any]:
    test = entry.get("test", {})
    return {"test_error": test.get("error"), "errors": entry["errors"] | test.get("errors", {})}


def _warnings(entry: Mapping[str, Any], materials: Sequence[Material]) -> tuple[str, ...]:
    """Of the entry; those of its test only where one of the materials is of it."""
    test = entry.get("test", {})
    among = any(material.name in test.get("errors", {}) for material in materials)
    return (*entry.get("warnings", ()), *(test.get("warnings", ()) if among else ()))
