"""The cheapest model within a tolerance: of each material, and of all with one and the same."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from fitters.fitting.sharing import SCOPES, Sharing
from gpsearch.judging.offers import Offer
from gpsearch.judging.tolerance import Tolerance

By = Literal["size", "speed"]

ORDERS: tuple[By, ...] = get_args(By)

Cost = tuple[float, ...]
"""What is compared first, and what decides between equals."""

Share = Callable[[Offer, tuple[str, ...]], Offer]
"""The offer with as few numbers for these materials as the tolerance allows."""


@dataclass(frozen=True, eq=False)
class Pick:
    """The offer for some materials: the cheapest within the tolerance or, where there is none, the nearest."""

    materials: tuple[str, ...]
    offer: Offer
    within: bool


def pick(
    offered: Sequence[Offer], names: tuple[str, ...], tolerance: Tolerance, by: By, share: Share
) -> Pick | None:
    """The pick for materials by name; None where no contender has a model of all of them."""
    able = [offer for offer in offered if set(names) <= set(offer.models)]
    if not able:
        return None
    within = [offer for offer in able if all(tolerance.holds(offer.values[name]) for name in names)]
    if not within:
        return Pick(names, max(able, key=lambda offer: _slack(offer, names, tolerance)), within=False)
    return Pick(names, _cheapest(within, names, tolerance, by, share), within=True)


def _cheapest(
    within: Iterable[Offer], names: tuple[str, ...], tolerance: Tolerance, by: By, share: Share
) -> Offer:
    """Numbers are shared only where that could make an offer the cheapest. Of equals the one with more slack."""

    def order(offer: Offer) -> tuple[Cost, float]:
        return cost(offer, len(names), by), -_slack(offer, names, tolerance)

    best: Offer | None = None
    for offer in sorted(within, key=lambda offer: (_least_cost(offer, len(names), by), order(offer))):
        if best is not None and _least_cost(offer, len(names), by) >= cost(best, len(names), by):
            break
        best = min((share(offer, names), *([best] if best else [])), key=order)
    assert best is not None
    return best


def cost(offer: Offer, materials: int, by: By) -> Cost:
    """By size, the words to store; by speed, nanoseconds, and of equals the words. Speeds must be known then."""
    return _cost(offer, offer.words(materials), by)


def _least_cost(offer: Offer, materials: int, by: By) -> Cost:
    """What it would cost if all that could be shared were."""
    if offer.sharing is None:
        return cost(offer, materials, by)
    widest = SCOPES[-1 if materials > 1 else 1]
    shared = Sharing(offer.sharing.names, (widest,) * len(offer.sharing.names))
    return _cost(offer, offer.nodes + shared.numbers(materials), by)


def _cost(offer: Offer, words: int, by: By) -> Cost:
    if by == "size":
        return (words,)
    assert offer.nanoseconds is not None
    return (offer.nanoseconds, words)


def _slack(offer: Offer, names: Iterable[str], tolerance: Tolerance) -> float:
    return min(tolerance.slack(offer.values[name]) for name in names)
