"""What a search remembers: fits by canonical form, the bar that they failed, and parents' parameters."""

import math

import numpy as np
import pytest

from fitters.expressions import parse
from fitters.expressions.canonical import canonical
from fitters.fits import Fit
from gpsearch.search.memory import Known, Memory


def fit(error=0.5, *, finished=True, values=((1.0, 2.0), (3.0, 4.0))):
    values = np.array(values)
    names = tuple(f"p{i}" for i in range(values.shape[1]))
    return Fit(names, values, np.full(len(values), error), error, 10, finished)


def form(text):
    return canonical(parse(text))


@pytest.fixture
def memory():
    return Memory({}, {})


def test_a_finished_fit_counts_under_every_bar(memory):
    memory.learn("p0", fit(), 0.1)
    assert memory.known["p0"] == Known(0.5)
    for bar in (0.01, 0.9, math.inf):
        assert memory.knows("p0", bar)
    assert not memory.knows("p1", 0.1)


def test_a_fit_that_was_given_up_counts_where_the_bar_is_no_higher(memory):
    memory.learn("p0", fit(finished=False), 0.3)
    assert memory.knows("p0", 0.3)
    assert memory.knows("p0", 0.2)
    assert not memory.knows("p0", 0.4)
    memory.learn("p0", fit(0.45), 0.4)
    assert memory.knows("p0", math.inf)


def test_what_is_smaller_than_it_was_is_new(memory):
    memory.seen["p0"] = 7
    assert memory.is_new("p0", 6)
    assert not memory.is_new("p0", 7)
    assert memory.is_new("p1", 100)


def test_a_warm_start_follows_the_parameters_names(memory):
    """A child inherits by the names of the expressions, whatever the canonical forms call them."""
    parent, child = "p3 * exp(p1 * wh.z)", "p1 * (wi.z + p3) + p2"
    memory.learn(form(parent).text, fit(values=[[1.0, 2.0], [3.0, 4.0]]), math.inf)
    memory.parents({parent: form(parent)}, lambda keys: {})
    by_own_name = {own: [1.0, 3.0] if name == "p0" else [2.0, 4.0] for own, name in form(parent).names.items()}
    warm = memory.warm_start(form(child), parent)
    assert warm is not None
    for own, name in form(child).names.items():
        np.testing.assert_array_equal(warm[name], by_own_name.get(own, [1.0, 1.0]))


def test_without_a_known_parent_there_is_no_warm_start(memory):
    assert memory.warm_start(form("p0 * wi.z"), "p0 * wh.z") is None
    memory.learn(form("p0 * wh.z").text, fit(values=[[1.0]]), math.inf)
    memory.parents({"p0 * wh.z": form("p0 * wh.z")}, lambda keys: {})
    assert memory.warm_start(form("wi.z / pi"), "p0 * wh.z") is None
    assert memory.warm_start(form("p0 * wi.z"), "p0 * wh.z") is not None


def test_a_fit_does_not_change_the_warm_starts_of_its_generation(memory):
    """Which of two fits is done first must not matter to the other."""
    parent = form("p0 * wh.z")
    memory.learn(parent.text, fit(values=[[1.0]]), math.inf)
    memory.parents({"p0 * wh.z": parent}, lambda keys: {})
    memory.learn(parent.text, fit(values=[[9.0]]), math.inf)
    warm = memory.warm_start(form("p0 * wi.z"), "p0 * wh.z")
    assert warm is not None
    assert warm["p0"] == [1.0]
    memory.parents({"p0 * wh.z": parent}, lambda keys: {})
    again = memory.warm_start(form("p0 * wi.z"), "p0 * wh.z")
    assert again is not None
    assert again["p0"] == [9.0]


def test_parents_are_kept_or_fetched_and_others_forgotten(memory):
    forms = {text: form(text) for text in ("p0 * wh.z", "p1 + wi.z")}
    kept, fetched = (f.text for f in forms.values())
    memory.learn(kept, fit(values=[[5.0]]), math.inf)
    memory.learn("sin(p0)", fit(values=[[6.0]]), math.inf)
    asked = []

    def load(keys):
        asked.extend(keys)
        return {key: np.float32([[7.0]]) for key in keys}

    memory.parents(forms, load)
    assert asked == [fetched]
    assert {key: float(values[0, 0]) for key, values in memory.parameters.items()} == {kept: 5.0, fetched: 7.0}
