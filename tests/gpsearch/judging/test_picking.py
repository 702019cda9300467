"""Picking against brute force over offers made up at random, with a sharer that is known."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from fitters.fitting.sharing import Sharing
from gpsearch.judging.contenders import Contender
from gpsearch.judging.offers import Offer
from gpsearch.judging.picking import pick
from gpsearch.judging.tolerance import parse_tolerance
from tests.gpsearch.entries import baseline, formula

NAMES = ("a", "b", "c")
TOLERANCE = parse_tolerance("psnr>=40 and light<=0.1")
SUBSETS = [("a",), ("c",), NAMES]


def offer(rng, number):
    """A table, or a formula of up to four parameters; every tenth has no model of `c`."""
    able = NAMES[:2] if number % 10 == 9 else NAMES
    is_formula = bool(rng.random() < 0.7)
    parameters = int(rng.integers(0, 5))
    if is_formula:
        symbols = {f"p{i}": {} for i in range(parameters)}
        entry = formula(f"o{number}", 0.1, int(rng.integers(5, 60)), expression="wh.z", parameters=symbols)
    else:
        entry = baseline(f"o{number}", 0.1, floats=int(rng.integers(10, 200)))
    values = {name: {"psnr": 40 + 12 * rng.normal(), "light": 0.1 * np.exp(rng.normal())} for name in able}
    sharing = Sharing.nothing([f"p{i}" for i in range(parameters)]) if is_formula else None
    return Offer(Contender(entry, {}), "run", float(rng.uniform(10, 99)), dict.fromkeys(able), values, sharing)


def shared(offer, names):
    """The first half of the parameters may be shared as far as it goes."""
    if offer.sharing is None:
        return offer
    widest = "set" if len(names) > 1 else "material"
    half = len(offer.sharing.names) // 2
    scopes = (widest,) * half + offer.sharing.scopes[half:]
    return replace(offer, sharing=replace(offer.sharing, scopes=scopes))


def within(offer, names):
    return all(offer.values[n]["psnr"] >= 40 and offer.values[n]["light"] <= 0.1 for n in names)


@pytest.mark.parametrize(("seed", "names"), list(itertools.product(range(20), SUBSETS)))
def test_nothing_within_is_cheaper_whatever_is_shared(seed, names):
    rng = np.random.default_rng(seed)
    offers = [offer(rng, number) for number in range(40)]
    able = [shared(one, names) for one in offers if set(names) <= set(one.models) and within(one, names)]
    count = len(names)
    by_size, by_speed = (pick(offers, names, TOLERANCE, by, shared) for by in ("size", "speed"))
    assert by_size.within == by_speed.within == bool(able)
    if able:
        words = [(one.contender.entry.nodes or 0) + one.numbers(count) for one in able]
        assert by_size.offer.nodes + by_size.offer.numbers(count) == min(words)
        assert by_speed.offer.nanoseconds == min(one.nanoseconds for one in able)
        assert within(by_size.offer, names)
        assert by_speed.offer.sharing == shared(by_speed.offer, names).sharing


@pytest.mark.parametrize(("seed", "names"), list(itertools.product(range(5), SUBSETS)))
def test_where_nothing_is_within_the_one_that_falls_least_short_is_nearest(seed, names):
    """Short by a factor of the error: 6 dB are a factor of 2."""
    rng = np.random.default_rng(seed)
    able = [one for one in (offer(rng, number) for number in range(40)) if set(names) <= set(one.models)]
    offers = [one for one in able if not within(one, names[:1])]

    def factor(one):
        return max(
            max(10 ** ((40 - one.values[name]["psnr"]) / 20), one.values[name]["light"] / 0.1) for name in names
        )

    found = pick(offers, names, TOLERANCE, "size", shared)
    assert not found.within
    assert factor(found.offer) == min(map(factor, offers))


def test_without_a_model_of_all_materials_nothing_is_picked():
    rng = np.random.default_rng(0)
    assert pick([offer(rng, 9)], NAMES, TOLERANCE, "size", shared) is None
    assert pick([offer(rng, 9)], ("a",), TOLERANCE, "size", shared) is not None
