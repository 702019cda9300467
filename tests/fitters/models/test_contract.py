"""What every model answers, checked on every kind of model fitted to real tables."""

import numpy as np
import pytest

from fitters.grid import SHAPE, cell_directions
from fitters.models.measured import MeasuredTable
from tests.fitters.models.conftest import GLOSSY, ROUGH
from tests.fitters.models.sphere import direction, directions, p_value, random_directions

VIEWS = (5, 45, 75)
FLOATS = {
    "measured-table": 3 * 90 * 90 * 180,
    "ggx": 12,
    "cook-torrance": 12,
    "not reciprocal": 9,
    # Table 2 of the factor paper, in floats of 4 bytes: 97,200, 3,264 and 4,344 bytes.
    "bivariate": 97_200 // 4,
    "npf-independent-g": 3_264 // 4,
    "npf-naive": 4_344 // 4,
    # without G, which follows from D
    "npf-g-from-d": 3_264 // 4 - 270,
    # six tables of 90
    "power-iterations": 540,
    # P, Q2 and G1 (90, 90), Q1 (90,), F (90, 3)
    "power-iterations-anisotropic": 3 * 8100 + 90 + 270,
}


def view(degrees, count):
    return np.tile(direction(np.radians(degrees), 0.3), (count, 1))


def turned(w):
    """Directions (n, 3), each pair turned by an angle of its own."""
    angle = np.random.default_rng(4).uniform(0, 2 * np.pi, len(w))
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([w[:, 0] * cosine - w[:, 1] * sine, w[:, 0] * sine + w[:, 1] * cosine, w[:, 2]], axis=-1)


def test_values_are_finite_and_not_negative_and_0_below_the_horizon(model):
    w_i, w_o = random_directions(5000, 1, least_cos=-1), random_directions(5000, 2, least_cos=-1)
    values = model.evaluate(w_i, w_o)
    assert values.shape == (5000, 3)
    assert np.all(np.isfinite(values))
    assert np.all(values >= 0)
    assert not values[(w_i[:, 2] <= 0) | (w_o[:, 2] <= 0)].any()
    assert values.any()


def test_the_ends_of_the_hemisphere_are_finite(model):
    """Grazing, normal, on the horizon: every pair, each with itself (retro-reflection) and with its opposite."""
    theta = np.arccos([1.0, 0.5, 1e-4, 1e-12, 0.0])
    ends = np.concatenate(
        [direction(theta, 0.0), direction(theta, np.pi), direction(theta, 2.0), [[1, 0, 1e-300]]]
    )
    ends = np.concatenate([ends, -ends])
    w_i, w_o = np.repeat(ends, len(ends), axis=0), np.tile(ends, (len(ends), 1))
    values, density = model.evaluate(w_i, w_o), model.pdf(w_i, w_o)
    assert np.all(np.isfinite(values) & (values >= 0))
    assert not values[(w_i[:, 2] <= 0) | (w_o[:, 2] <= 0)].any()
    assert np.all(np.isfinite(density) & (density >= 0))


def test_no_direction_has_no_value(model):
    up = np.array([[0.0, 0.0, 1.0]])
    for broken in ([np.nan, 0, 1], [0, np.nan, 1], [0, 0, np.nan], [np.inf, 0, 1]):
        assert not model.evaluate(np.array([broken]), up).any()
        assert not model.evaluate(up, np.array([broken])).any()
    none = np.empty((0, 3))
    assert model.evaluate(none, none).shape == model.sample(none, none).shape == (0, 3)
    assert model.pdf(none, none).shape == (0,)


def test_layout_and_type_of_directions_do_not_matter(model):
    w_i, w_o = (w.astype(np.float32) for w in (random_directions(500, 1), random_directions(500, 2)))
    u = np.random.default_rng(3).random((500, 3), np.float32)
    wide = [x.astype(np.float64) for x in (w_i, w_o, u)]
    for one, other, numbers in ((w_i, w_o, u), tuple(np.asfortranarray(x) for x in wide)):
        np.testing.assert_array_equal(model.evaluate(one, other), model.evaluate(*wide[:2]))
        np.testing.assert_array_equal(model.pdf(one, other), model.pdf(*wide[:2]))
        np.testing.assert_array_equal(model.sample(other, numbers), model.sample(wide[1], wide[2]))


def test_is_reciprocal_where_it_claims_to_be(request, model):
    """At centres of bins, turned about the normal: rounding takes no pair into another bin."""
    w_i, w_o = (turned(w[::59]) for w in cell_directions())
    forth, back = model.evaluate(w_i, w_o), model.evaluate(w_o, w_i)
    assert forth.any()
    claimed = request.node.callspec.params["model"][0] != "not reciprocal"
    assert model.reciprocal is claimed
    assert np.allclose(forth, back, rtol=1e-6, atol=1e-12) is claimed


def test_size_and_times(request, model):
    name = request.node.callspec.params["model"][0]
    assert model.floats == FLOATS[name]
    assert model.fit_seconds > 0 or isinstance(model, MeasuredTable)
    assert 0 < model.cost_ns() < np.inf


@pytest.mark.parametrize("degrees", VIEWS)
def test_the_density_integrates_to_one(model, degrees):
    w_i, measure = directions(view(degrees, 1)[0])
    density = model.pdf(w_i, view(degrees, len(w_i)))
    assert np.all(density >= 0)
    assert np.sum(density * measure) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("degrees", VIEWS)
def test_samples_have_the_density(model, degrees):
    count = 200_000
    w_o = view(degrees, count)
    w_i = model.sample(w_o, np.random.default_rng(7).random((count, 3)))
    np.testing.assert_allclose(np.linalg.norm(w_i, axis=1), 1, atol=1e-9)
    assert p_value(model, w_o[0], w_i) > 1e-4


@pytest.mark.parametrize("degrees", VIEWS)
def test_sampled_albedo_is_the_integrated_one(model, degrees):
    count = 100_000
    w_o = view(degrees, count)
    w_i = model.sample(w_o, np.random.default_rng(3).random((count, 3)))
    cos_i = np.maximum(w_i[:, 2:], 0.0)
    weights = model.evaluate(w_i, w_o) * cos_i / model.pdf(w_i, w_o)[:, None]
    at, measure = directions(w_o[0])
    values = model.evaluate(at, view(degrees, len(at)))
    albedo = (np.maximum(at[:, 2], 0.0) * measure) @ values
    error = 4 * weights.std(axis=0) / np.sqrt(count) + 2e-3 * albedo
    assert np.all(np.abs(weights.mean(axis=0) - albedo) < error)


@pytest.mark.parametrize("material", [GLOSSY, ROUGH])
@pytest.mark.parametrize("name", ["npf-independent-g", "npf-g-from-d", "npf-naive", "bivariate", "measured-table"])
def test_cell_centres_read_what_was_fitted(fitted, name, material):
    """The papers' equations over the stored arrays, at the centres of the grid, up to 89 degrees."""
    model = fitted(name, material)
    w_i, w_o = (w[::101] for w in cell_directions())
    h, d, p = (index[::101] for index in np.unravel_index(np.arange(len(cell_directions()[0])), SHAPE))
    seen = np.minimum(w_i[:, 2], w_o[:, 2]) > np.cos(np.radians(89))
    arrays = model.arrays()
    if name == "measured-table":
        expected = arrays["table"][:, h, d, p].T
    elif name == "bivariate":
        expected = arrays["B"][h, d]
    else:
        factor = arrays["D"][h] * arrays["F"][d]
        if name == "npf-naive":
            factor = factor * arrays["H"][p]
        else:
            for w in (w_i, w_o):
                at = np.degrees(np.arccos(np.clip(w[:, 2], -1, 1)))
                g = np.stack([np.interp(at, np.arange(90), column) for column in arrays["G"].T], axis=-1)
                factor = factor * g / w[:, 2:]
        expected = arrays["rho_d"] + arrays["rho_s"] * factor
    np.testing.assert_allclose(model.evaluate(w_i, w_o)[seen], expected[seen], rtol=1e-9)
