"""The paper's alternation: linear steps that are the best there are, and an objective that never rises."""

import numpy as np
import pytest
from scipy.optimize import nnls

from fitters.materials import load_material
from fitters.models.factors import awls
from fitters.models.factors.alternation import shadowed_sums
from fitters.models.factors.channel import Channel
from fitters.models.factors.descent import descend
from fitters.models.factors.problems import GFromD, IndependentG
from fitters.models.factors.samples import samples
from fitters.models.factors.smith import smith
from fitters.models.factors.starts import slices, starts


@pytest.fixture(scope="module")
def whole():
    """Unfolded samples of a metal's green channel, every ninth azimuth."""
    return samples(load_material("builtin:metal"), folded=False)[1].every(9)


@pytest.fixture(scope="module")
def random_start():
    d, f, g = np.random.default_rng(1).uniform(0.1, 1.0, (3, 90))
    return Channel(0.0, 1.0, d, f, g).clamped()


def flat(whole, channel):
    """The lobe of every sample, and root weights."""
    at = whole.geometry
    row = np.repeat(np.arange(8100), np.diff(at.offset))
    places = (n + p.astype(float) for n, p in ((at.node_i, at.part_i), (at.node_o, at.part_o)))
    g_i, g_o = (np.interp(place, np.arange(90), channel.g) for place in places)
    lobe = channel.d[row // 90] * channel.f[row % 90] * g_i * g_o / at.cosines
    return row, lobe, np.sqrt(whole.weights.astype(float))


def test_the_coefficients_are_the_least_squares_solution(whole, random_start):
    _, lobe, root = flat(whole, random_start)
    known = shadowed_sums(whole, random_start.g)
    found = known.coefficients(random_start.d, random_start.f)
    columns = root[:, None] * np.stack([np.ones(len(lobe)), lobe], axis=1)
    expected = nnls(columns, root * whole.values)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_the_objective_is_the_weighted_sum_of_squares(whole, random_start):
    _, lobe, root = flat(whole, random_start)
    known = shadowed_sums(whole, random_start.g)
    expected = np.sum((root * (0.1 + 2.0 * lobe - whole.values)) ** 2)
    assert known.objective(0.1, 2.0, random_start.d, random_start.f) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("k", [0, 20, 60])
def test_a_component_is_the_best_with_all_else_held(whole, random_start, k):
    row, lobe, root = flat(whole, random_start)
    known = shadowed_sums(whole, random_start.g)
    here = row // 90 == k
    per_unit, w, z = 0.5 * lobe[here] / random_start.d[k], root[here] ** 2, whole.values[here] - 0.01
    expected = np.sum(w * per_unit * z) / np.sum(w * per_unit**2)
    found = known.best_d(0.01, 0.5, random_start.d, random_start.f, floor=0.0)[k]
    assert found == pytest.approx(max(expected, 0.0), rel=1e-3)
    there = row % 90 == k
    per_unit, w, z = 0.5 * lobe[there] / random_start.f[k], root[there] ** 2, whole.values[there] - 0.01
    if np.sum(w) > 0:
        expected = np.sum(w * per_unit * z) / np.sum(w * per_unit**2)
        found = known.best_f(0.01, 0.5, random_start.d, random_start.f, floor=0.0)[k]
        assert found == pytest.approx(max(expected, 0.0), rel=1e-3)


def test_g_on_one_side_is_the_best_with_the_other_held(whole, random_start):
    """Against a minimiser that knows nothing of bands."""
    at = whole.geometry
    row, _, root = flat(whole, random_start)
    base = random_start.d[row // 90] * random_start.f[row % 90]

    def left(g):
        g_i = g[at.node_i] + at.part_i * (g[at.node_i + 1] - g[at.node_i])
        o = random_start.g
        g_o = o[at.node_o] + at.part_o * (o[at.node_o + 1] - o[at.node_o])
        return root * (base * g_i * g_o / at.cosines - whole.values)

    bands, right = np.zeros((2, 90)), np.zeros(90)
    awls._g_equations(
        0.0, 1.0, random_start.d, random_start.f, random_start.g, at.offset, at.node_i, at.part_i, at.node_o,
        at.part_o, at.cosines, whole.weights, whole.values, bands, right,
    )  # fmt: skip
    matrix = np.diag(bands[1]) + np.diag(bands[0][1:], 1) + np.diag(bands[0][1:], -1)
    step = 1e-3
    for node in (3, 40, 80):
        up, down = (random_start.g + sign * step * np.eye(90)[node] for sign in (1, -1))
        slope = (np.sum(left(up) ** 2) - np.sum(left(down) ** 2)) / (2 * step)
        assert slope / 2 == pytest.approx((matrix @ random_start.g - right)[node], rel=1e-3)


ALTERNATIONS = {
    "independent-g": lambda s, start: awls.alternate_independent_g(s, start, rounds=25, tolerance=1e-6),
    "g-from-d": lambda s, start: awls.alternate_g_from_d(s, smith(), start, rounds=25, tolerance=1e-6),
    "naive": lambda s, start: awls.alternate_naive(
        s, Channel(0.0, 1.0, start.d, start.f, np.ones(s.geometry.phi.size)), rounds=25, tolerance=1e-6
    ),
}


@pytest.mark.parametrize("model", ALTERNATIONS)
@pytest.mark.parametrize("material", ["metal", "glossy-plastic", "fabric"])
def test_the_objective_never_rises(model, material, random_start, monkeypatch):
    """At any update, by the objective written down once more."""
    channel = samples(load_material(f"builtin:{material}"), folded=False)[0].every(9)
    visited = []
    take = awls._Course.take

    def remembered(course, trial, **how):
        falls = take(course, trial, **how)
        visited.append(course.channel)
        return falls

    monkeypatch.setattr(awls._Course, "take", remembered)
    for start in (slices(channel), random_start):
        visited.clear()
        found = ALTERNATIONS[model](channel, start)
        values = np.array([plainly(channel, at) for at in visited])
        assert len(values) >= 6
        assert np.all(np.diff(values) <= 1e-6 * values[0])
        assert values[-1] == pytest.approx(found.objective, rel=1e-4)
        assert values[-1] < 0.95 * found.course[0]


@pytest.mark.parametrize("model", ["independent-g", "g-from-d"])
def test_the_descent_never_rises(model, random_start):
    """Nor does the other solver: a descent of k steps ends where one of more steps has been."""
    channel = samples(load_material("builtin:metal"), folded=False)[1].every(9)
    problem = IndependentG(channel, 0.0) if model == "independent-g" else GFromD(channel, smith())
    x = random_start.unknowns()[: 271 if model == "independent-g" else 181]
    values = []
    for steps in range(8):
        end = descend(problem, x, iterations=steps, tolerance=0.0).x
        g = None if model == "independent-g" else smith().shadowing(np.exp(end[1:91]))
        values.append(plainly(channel, Channel.of_unknowns(end, g)))
    assert np.all(np.diff(values) <= 0)
    assert values[-1] < 0.5 * values[0]


def plainly(channel, at):
    """Eq. 7 of a channel's factors on samples, with G or with H."""
    places = channel.geometry
    row = np.repeat(np.arange(8100), np.diff(places.offset))
    if len(at.g) == 90:
        _, lobe, root = flat(channel, at)
    else:
        azimuth = np.arange(len(places)) - places.offset[row] + places.first.ravel()[row]
        lobe, root = at.d[row // 90] * at.f[row % 90] * at.g[azimuth], np.sqrt(channel.weights.astype(float))
    return float(np.sum((root * (at.rho_d + at.rho_s * lobe - channel.values)) ** 2))


def test_a_search_is_called_where_smoothing_makes_the_objective_rise():
    """G of a metal is steep at grazing: after some rounds no smoothed one is better, and the first is searched."""
    channel = samples(load_material("builtin:metal"), folded=False)[1].every(9)
    found = awls.alternate_independent_g(channel, slices(channel), rounds=60, tolerance=1e-7)
    assert found.searches > 0


def test_starts_are_the_eight_of_the_paper(whole):
    chosen = starts(slices)
    assert len(chosen) == 8
    for start in chosen.values():
        channel = start(whole)
        assert all(np.all(np.isfinite(x) & (x > 0)) for x in (channel.d, channel.f, channel.g))
    assert not np.array_equal(chosen["random-1"](whole).g, chosen["random-2"](whole).g)
