"""What an island remembers: fits by canonical form, the bar that they did not reach, and parents' parameters."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fitters.expressions import parse
from fitters.expressions.canonical import canonical
from fitters.fitting import Fit
from gpsearch.run import Known
from gpsearch.search.memory import Memory, SharedKnowledge

ISLAND = 3


def fit(error=0.5, *, finished=True, values=((1.0, 2.0), (3.0, 4.0))):
    values = np.array(values)
    names = tuple(f"p{i}" for i in range(values.shape[1]))
    return Fit(names, values, np.full(len(values), error), error, 10, finished)


def form(text):
    return canonical(parse(text))


def nothing_stored(fits):
    return {}


@pytest.fixture
def memory():
    return Memory(ISLAND, SharedKnowledge())


def test_a_finished_fit_counts_under_every_bar(memory):
    memory.learn("p0", fit(), 0.1, 7)
    assert memory["p0"] == Known(0.5, 0.0, math.inf, ISLAND, 7)
    for bar in (0.01, 0.9, math.inf):
        assert memory.knows("p0", bar)
    assert not memory.knows("p1", 0.1)


def test_a_fit_that_was_given_up_counts_where_the_bar_is_no_higher(memory):
    memory.learn("p0", fit(finished=False), 0.3, 7)
    assert memory.knows("p0", 0.3)
    assert memory.knows("p0", 0.2)
    assert not memory.knows("p0", 0.4)
    memory.learn("p0", fit(0.45), 0.4, 8)
    assert memory.knows("p0", math.inf)


def test_the_smallest_size_that_occurred_counts(memory):
    assert memory.smallest("p0") == math.inf
    memory.shared.add_sizes([("p0", 7), ("p0", 9)])
    assert memory.smallest("p0") == 7
    memory.end_generation([], {"p0": 5})
    assert memory.smallest("p0") == 5


@given(st.permutations(range(5)))
def test_islands_join_what_they_know_in_any_order(order):
    """Of one form, a finished fit counts more than one given up, and of equals the older one."""
    memories = [Memory(island, SharedKnowledge()) for island in range(5)]
    for memory, (bar, generation) in zip(
        memories, [(0.3, 1), (math.inf, 4), (math.inf, 2), (0.9, 1), (math.inf, 2)], strict=True
    ):
        memory.learn("p0", fit(finished=bar == math.inf), bar, generation)
        memory.end_generation([], {"p0": 10 - memory.island})
    shared = SharedKnowledge()
    shared.join(memories[i] for i in order)
    assert (shared.fits["p0"].island, shared.fits["p0"].generation) == (2, 2)
    assert shared.sizes == {"p0": 6}


def test_an_island_does_not_know_what_others_found_since(memory):
    other = Memory(4, memory.shared)
    other.learn("p0", fit(), math.inf, 1)
    other.end_generation([], {"p0": 1})
    assert memory.find("p0") is None
    memory.shared.join([other])
    assert memory["p0"].island == 4


def test_a_warm_start_follows_the_parameters_names(memory):
    """A child inherits by the names of the expressions, whatever the canonical forms call them."""
    parent, child = "p3 * exp(p1 * wh.z)", "p1 * (wi.z + p3) + p2"
    memory.learn(form(parent).text, fit(values=[[1.0, 2.0], [3.0, 4.0]]), math.inf, 1)
    memory.end_generation([], {})
    memory.parents([parent], {parent: form(parent)}, nothing_stored)
    by_own_name = {own: [1.0, 3.0] if name == "p0" else [2.0, 4.0] for own, name in form(parent).names.items()}
    warm = memory.warm_start(form(child), parent)
    assert warm is not None
    for own, name in form(child).names.items():
        np.testing.assert_array_equal(warm[name], by_own_name.get(own, [1.0, 1.0]))


def test_without_a_known_parent_there_is_no_warm_start(memory):
    assert memory.warm_start(form("p0 * wi.z"), "p0 * wh.z") is None
    memory.learn(form("p0 * wh.z").text, fit(values=[[1.0]]), math.inf, 1)
    memory.end_generation([], {})
    memory.parents(["p0 * wh.z"], {}, nothing_stored)
    assert memory.warm_start(form("wi.z / pi"), "p0 * wh.z") is None
    assert memory.warm_start(form("p0 * wi.z"), "p0 * wh.z") is not None


def test_a_fit_does_not_change_the_warm_starts_of_its_generation(memory):
    """Which of two fits is done first must not matter to the other."""
    parent, text = form("p0 * wh.z"), "p0 * wh.z"
    memory.learn(parent.text, fit(values=[[1.0]]), math.inf, 1)
    memory.end_generation([], {})
    memory.parents([text], {}, nothing_stored)
    memory.learn(parent.text, fit(values=[[9.0]]), math.inf, 2)
    warm = memory.warm_start(form("p0 * wi.z"), text)
    assert warm is not None
    assert warm["p0"] == [1.0]
    memory.end_generation([], {})
    memory.parents([text], {}, nothing_stored)
    again = memory.warm_start(form("p0 * wi.z"), text)
    assert again is not None
    assert again["p0"] == [9.0]


def test_parents_are_kept_or_fetched_and_others_forgotten(memory):
    kept, fetched = "p0 * wh.z", "p1 + wi.z"
    memory.shared.fits[form(fetched).text] = Known(0.5, island=1, generation=2)
    memory.learn(form(kept).text, fit(values=[[5.0]]), math.inf, 6)
    memory.learn("sin(p0)", fit(values=[[6.0]]), math.inf, 6)
    memory.end_generation([], {})
    asked = {}

    def load(fits):
        asked.update(fits)
        return {key: np.float32([[7.0]]) for key in fits}

    memory.parents([kept, fetched], {}, load)
    assert asked == {form(fetched).text: Known(0.5, island=1, generation=2)}
    warm = [memory.warm_start(form("p0 * wi.z"), parent) for parent in (kept, fetched)]
    assert [float(columns["p0"][0]) for columns in warm if columns] == [5.0, 1.0]
