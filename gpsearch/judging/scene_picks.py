"""What was picked in a scene, for programs and for readers."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from fitters.expressions import parse
from fitters.fitting.reduction import CellReduction, Price, prices, reduction
from fitters.fitting.sharing import SCOPES
from fitters.models import FormulaModel
from fitters.scenes import LightTable
from gpsearch.judging.offers import Offer, Refitter
from gpsearch.judging.picking import By, Pick
from gpsearch.judging.scenes import NamedScene
from gpsearch.judging.tolerance import Tolerance


@dataclass(frozen=True, eq=False)
class ScenePicks:
    """The picks in a scene, of each material and of all, beside everything that was offered.

    A pick is None where no contender has a model. `prices` are those of the formula picked for all materials.
    """

    scene: NamedScene
    offered: Sequence[Offer]
    alone: Mapping[str, Pick | None]
    together: Pick | None
    reduction: CellReduction
    prices: Mapping[str, Price]

    @classmethod
    def of(
        cls,
        scene: NamedScene,
        offered: Sequence[Offer],
        alone: Mapping[str, Pick | None],
        together: Pick | None,
        refitter: Refitter,
        turned: LightTable,
    ) -> "ScenePicks":
        problem, paid = refitter.problem, {}
        if together is not None and together.offer.sharing is not None:
            fit, contender = refitter.fit_of(together.offer.models, problem), together.offer.contender
            bounds = refitter.bounds_of(contender)
            paid = prices(parse(contender.entry.expression or ""), problem, bounds, fit, refitter.settings, turned)
        return cls(scene, offered, alone, together, reduction(problem), paid)


def picks_json(scenes: Sequence[ScenePicks], tolerance: Tolerance, by: By) -> dict[str, Any]:
    """Plain objects; numbers that are infinite, of equal pictures, are null."""
    return {
        "tolerance": [asdict(limit) for limit in tolerance.limits],
        "by": by,
        "scenes": [
            {
                "scene": {"name": one.scene.name, **asdict(one.scene.scene)},
                "cells": asdict(one.reduction),
                "materials": {name: _pick_json(picked, tolerance) for name, picked in one.alone.items()},
                "all": _pick_json(one.together, tolerance),
                "prices": {name: asdict(price) for name, price in one.prices.items()},
                "models": [_offer_json(offer, tolerance) for offer in one.offered],
            }
            for one in scenes
        ],
    }


def _offer_json(offer: Offer, tolerance: Tolerance) -> dict[str, Any]:
    entry = offer.contender.entry
    return {
        "name": entry.name,
        "kind": entry.kind,
        "expression": entry.expression,
        "nodes": entry.nodes,
        "fitted_in": offer.fitted_in,
        "floats": entry.floats,
        "ns": offer.nanoseconds,
        "values": {
            name: {metric: _finite(value) for metric, value in values.items()}
            for name, values in offer.values.items()
        },
        "within": {name: tolerance.holds(values) for name, values in offer.values.items()},
    }


def _pick_json(picked: Pick | None, tolerance: Tolerance) -> dict[str, Any] | None:
    if picked is None:
        return None
    offer, names = picked.offer, picked.materials
    values = {name: offer.values[name] for name in names}
    return {
        "within": picked.within,
        "name": offer.contender.entry.name,
        "kind": offer.contender.entry.kind,
        "expression": offer.contender.entry.expression,
        "nodes": offer.contender.entry.nodes,
        "fitted_in": offer.fitted_in,
        "numbers": offer.numbers(len(names)),
        "words": offer.words(len(names)),
        "ns": offer.nanoseconds,
        "sharing": dict(zip(offer.sharing.names, offer.sharing.scopes, strict=True)) if offer.sharing else None,
        "parameters": _parameters(offer, names),
        "values": {name: {m: _finite(v) for m, v in of_material.items()} for name, of_material in values.items()},
        "margins": {
            name: {limit.metric: _finite(limit.margin(of_material[limit.metric])) for limit in tolerance.limits}
            for name, of_material in values.items()
        },
    }


def _parameters(offer: Offer, names: Sequence[str]) -> dict[str, dict[str, list[float]]] | None:
    """As in an exported front: by parameter, by material, one value a channel."""
    models = {name: offer.models[name] for name in names}
    formulas = {name: model for name, model in models.items() if isinstance(model, FormulaModel)}
    if len(formulas) < len(models):
        return None
    symbols = next(iter(formulas.values())).expression.parameters
    return {
        symbol: {name: model.parameters[:, column].tolist() for name, model in formulas.items()}
        for column, symbol in enumerate(symbols)
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def picks_text(picks: ScenePicks, tolerance: Tolerance, by: By) -> str:
    """A table with a line for each material and one for all, the formulas, and what the scene leaves open."""
    cells = picks.reduction
    rows = [*picks.alone.items(), ("all with one model", picks.together)]
    widest = max(len(name) for name, _ in rows)
    metrics = f"{'time':>10s}" if by == "speed" else ""
    metrics += "".join(f"{limit.metric:>14s}{'margin':>9s}" for limit in tolerance.limits)
    lines = [
        f"{picks.scene.name}: {tolerance}, the cheapest by {by}",
        f"{'':{widest}s}  {'model':32s}{'words':>8s}{'numbers':>9s}{metrics}",
    ]
    lines += [f"{name:{widest}s}  {_row(picked, tolerance)}" for name, picked in rows]
    lines += _remarks(picks)
    lines.append(
        f"{cells.lit:,} of {cells.measured:,} measured cells are lit; {cells.carrying[0.99]:,} of them carry 99 % "
        "of what is seen"
    )
    for name, price in picks.prices.items():
        beyond = f", {price.beyond:.4f} where the scene does not look" if cells.lit < cells.measured else ""
        lines.append(
            f"  the formula for all, free and fitted to {price.cells:,} cells ({name}): light error "
            f"{price.scene:.4f}, {price.turned:.4f} with the light turned half round{beyond}"
        )
    return "\n".join(lines)


def _row(picked: Pick | None, tolerance: Tolerance) -> str:
    if picked is None:
        return "no model was fitted"
    offer, count = picked.offer, len(picked.materials)
    title = offer.contender.entry.title if picked.within else f"none; nearest {offer.contender.entry.title}"
    row = f"{title:32s}{offer.words(count):8,d}{offer.numbers(count):9,d}"
    if offer.nanoseconds is not None:
        row += f"{offer.nanoseconds:7.1f} ns"
    for limit in tolerance.limits:
        value = min((offer.values[name][limit.metric] for name in picked.materials), key=limit.margin)
        row += f"{value:14.4g}{limit.margin(value):+9.3g}"
    return row


def _remarks(picks: ScenePicks) -> list[str]:
    """Every formula that was picked, once for each way in which its parameters are shared."""
    offers = [picked.offer for picked in (*picks.alone.values(), picks.together) if picked is not None]
    return list(dict.fromkeys(_formula(offer) for offer in offers if offer.sharing is not None))


def _formula(offer: Offer) -> str:
    assert offer.sharing is not None
    by_scope = {
        scope: [n for n, s in zip(offer.sharing.names, offer.sharing.scopes, strict=True) if s == scope]
        for scope in SCOPES
    }
    each = ", ".join(f"{' '.join(names)} per {scope}" for scope, names in by_scope.items() if names)
    refitted = ", fitted in this scene" if offer.fitted_in == "scene" else ""
    return (
        f"{offer.contender.entry.title}{refitted}, {each or 'no parameters'}: {offer.contender.entry.expression}"
    )
