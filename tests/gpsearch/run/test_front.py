"""The front against its definition."""

from itertools import pairwise
from math import inf

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fitters.fitting import Fit
from gpsearch.genomes import Genome
from gpsearch.run import Front, Member, Screened
from gpsearch.run.front import SAME

ERRORS = st.one_of(st.sampled_from([0.0, 0.1, 0.2, 0.3, inf]), st.floats(0, 1))


def member(expression: str, nodes: int, error: float, screened: float | None = None) -> Member:
    fit = Fit(("p0",), np.ones((3, 1)), np.full(3, error), error, 1)
    return Member(expression, nodes, Genome("p0"), 0, 1, fit, error if screened is None else screened)


@st.composite
def members(draw: st.DrawFn) -> list[Member]:
    """Of few sizes and errors, so that ties occur; an expression has one size and one error."""
    names = draw(st.lists(st.text("abc", min_size=1, max_size=3), unique=True, max_size=12))
    return [member(name, draw(st.integers(1, 6)), draw(ERRORS)) for name in names]


def dominates(one: Member, other: Member) -> bool:
    no_worse = one.nodes <= other.nodes and one.error <= other.error
    better = one.nodes < other.nodes or one.error < other.error
    return no_worse and (better or one.expression < other.expression)


def by_definition(pool: list[Member]) -> set[str]:
    finite = [m for m in pool if m.error < inf]
    return {m.expression for m in finite if not any(dominates(other, m) for other in finite)}


@settings(deadline=None)
@given(members())
def test_the_front_is_what_no_other_beats(pool):
    front = Front().updated(pool)
    assert {m.expression for m in front.members} == by_definition(pool)
    assert all(a.nodes < b.nodes and a.error > b.error for a, b in pairwise(front.members))


@settings(deadline=None)
@given(members(), st.randoms(use_true_random=False), st.integers(0, 12))
def test_the_front_does_not_depend_on_the_order_in_which_candidates_come(pool, random, cut):
    shuffled = list(pool)
    random.shuffle(shuffled)
    at_once = Front().updated(pool)
    in_two = Front().updated(shuffled[:cut]).updated(shuffled[cut:])
    assert [m.expression for m in in_two.members] == [m.expression for m in at_once.members]


@settings(deadline=None)
@given(members(), members())
def test_whatever_would_enter_is_worth_confirming(pool, candidates):
    """Where the sample tells the truth, no candidate that would be on the front is refused."""
    front = Front().updated(pool)
    known = {m.expression for m in pool}
    new = [c for c in candidates if c.expression not in known]
    worth = front.worth_confirming(Screened(c.expression, c.nodes, c.error) for c in new)
    entered = {m.expression for m in front.updated(new).members} - {m.expression for m in front.members}
    repeated = {
        c.expression
        for c in new
        if any(
            other.nodes <= c.nodes and abs(other.error - c.error) <= SAME * c.error
            for other in (*front.members, *new)
            if other is not c
        )
    }
    assert entered - repeated <= set(worth)
    assert len(worth) == len(set(worth))


def test_what_is_not_finite_is_not_worth_confirming():
    assert Front().worth_confirming([Screened("a", 1, inf), Screened("b", 2, 0.5)]) == ["b"]
    assert Front().updated([member("a", 1, inf)]).members == ()


def test_a_member_that_the_sample_flattered_does_not_shut_the_door():
    front = Front((member("a", 3, error=0.5, screened=0.1),))
    assert front.worth_confirming([Screened("b", 4, 0.3), Screened("c", 4, 0.6)]) == ["b"]


def test_a_member_that_the_sample_wronged_does_not_shut_the_door_either():
    front = Front((member("a", 3, error=0.1, screened=0.5),))
    assert front.worth_confirming([Screened("b", 4, 0.3)]) == ["b"]


def test_a_member_stays_as_it_is_when_its_expression_comes_again():
    first = member("a", 1, 0.5)
    front = Front((first,)).updated([member("a", 1, 0.5)])
    assert front.members[0] is first


def test_what_is_within_a_standard_error_is_worth_confirming():
    front = Front((member("a", 3, error=0.5, screened=0.5),))
    near, far = Screened("b", 4, 0.504, 0.005), Screened("c", 4, 0.506, 0.005)
    assert front.worth_confirming([near, far]) == ["b"]


def test_a_candidate_that_the_sample_flatters_does_not_keep_a_larger_one_out():
    flattered, larger = Screened("b", 4, 0.30, 0.01), Screened("c", 5, 0.305, 0.01)
    assert Front().worth_confirming([flattered, larger]) == ["b", "c"]


def test_the_same_function_at_greater_length_is_passed_over():
    front = Front((member("a", 3, error=0.52, screened=0.5),))
    longer, new = Screened("b", 4, 0.50001, 0.1), Screened("c", 4, 0.49, 0.0)
    assert front.worth_confirming([longer, new, Screened("d", 6, 0.49, 0.1)]) == ["c"]
