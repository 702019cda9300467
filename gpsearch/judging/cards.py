"""Cards of many models: every contender judged on every material in a scene."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import numpy as np

from fitters.judging.card import Card, Judge
from fitters.judging.metrics import CARD_METRICS, METRICS
from fitters.materials import Material
from fitters.rendering import Picture
from gpsearch.judging.contenders import Contender
from gpsearch.judging.scenes import NamedScene


@dataclass(frozen=True, eq=False)
class Shown:
    """A model of a material: its card, and the pictures it is about."""

    material: str
    card: Card
    truth: Picture
    picture: Picture


@dataclass(frozen=True, eq=False)
class CardsOfModel:
    """A contender with its cards by material; materials that it has no model of are not there."""

    contender: Contender
    cards: Mapping[str, Card]

    def only(self, materials: Collection[str]) -> "CardsOfModel":
        """The same with the cards of some materials."""
        return CardsOfModel(self.contender, {name: card for name, card in self.cards.items() if name in materials})

    def mean(self, metric: str) -> float:
        """Over materials; of PSNR that of the decibels, as the factor paper's tables are."""
        return float(np.mean([card.metrics[metric] for card in self.cards.values()]))

    def worst_materials(self) -> dict[str, str]:
        """By metric; nothing where there is no card."""
        return {metric: self.worst_material(metric) for metric in CARD_METRICS} if self.cards else {}

    def worst_material(self, metric: str) -> str:
        """The material on which the metric is worst."""
        sign = -1.0 if METRICS[metric].higher_is_better else 1.0
        return max(self.cards, key=lambda name: sign * self.cards[name].metrics[metric])


def shown(
    contenders: Sequence[Contender], materials: Sequence[Material], scene: NamedScene
) -> Iterator[tuple[Contender, list[Shown]]]:
    """Every contender in its order, with what it shows of every material in the scene.

    Raises `FittersError` for a bad light, or a scene in which a material is black.
    """
    image, light = scene.image(), scene.light()
    judges = [Judge(image, light, material) for material in materials]
    for contender in contenders:
        seen = []
        for judge in judges:
            name = judge.material.name
            if name in contender.models:
                card, picture = judge.card(contender.models[name])
                seen.append(Shown(name, card, judge.truth, picture))
        yield contender, seen


def judged(
    contenders: Sequence[Contender], materials: Sequence[Material], scene: NamedScene
) -> Iterator[CardsOfModel]:
    """Every contender with its cards, in its order; errors as `shown`."""
    for contender, seen in shown(contenders, materials, scene):
        yield CardsOfModel(contender, {one.material: one.card for one in seen})


def protocols() -> dict[str, dict[str, str]]:
    """How every metric is computed, in words."""
    return {name: metric.describe() for name, metric in CARD_METRICS.items()}


def judged_json(judged: CardsOfModel, tests: Collection[str] = ()) -> dict[str, Any]:
    """A model's cards as plain objects; an infinite PSNR, of equal pictures, is null.

    The worst of the materials is one that is no test; where there are tests, they have a worst one of their own.
    """
    entry = judged.contender.entry
    searched_on = judged.only([name for name in judged.cards if name not in tests])
    worst_test = {"worst_test_material": judged.only(tests).worst_materials()} if tests else {}
    return {
        "name": entry.name,
        "kind": entry.kind,
        "expression": entry.expression,
        "nodes": entry.nodes,
        "floats": entry.floats,
        "warnings": list(judged.contender.warnings),
        "worst_material": searched_on.worst_materials(),
        **worst_test,
        "cards": {name: _card_json(card) for name, card in judged.cards.items()},
    }


def _card_json(card: Card) -> dict[str, Any]:
    metrics = {name: value if isfinite(value) else None for name, value in card.metrics.items()}
    return {"metrics": metrics, "worst_region": asdict(card.worst), "unmeasured": card.unmeasured}
