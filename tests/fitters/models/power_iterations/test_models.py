"""Both models keep the contract: reciprocal, finite, samples of exactly their density, stored and loaded again."""

import numpy as np
import pytest
from scipy.stats import chisquare

from fitters.models import load
from fitters.models.power_iterations import (
    Settings,
    TabulatedMicrofacet,
    extract,
    extract_anisotropic,
    isotropic,
)
from tests.fitters.models.conftest import save
from tests.fitters.models.power_iterations.closed_forms import Surface, direction, material, random_directions

ISOTROPIC = Surface("ggx", 0.35, fresnel=(0.9, 0.6, 0.3))
ANISOTROPIC = Surface("beckmann", 0.6, 0.25, 0.7, fresnel=(0.9, 0.6, 0.3))


@pytest.fixture(scope="module")
def table():
    return material(ISOTROPIC.brdf)


@pytest.fixture(scope="module")
def models(table):
    radial, anisotropic = extract(table).model, extract_anisotropic(ANISOTROPIC.brdf).model
    return {
        "isotropic": radial,
        "published": extract(table, Settings.reference()).model,
        "roughened": radial.roughened(1.5, 0.5),
        "anisotropic": anisotropic,
        "anisotropic, roughened": anisotropic.roughened(0.5, 2.0),
    }


@pytest.fixture(params=["isotropic", "published", "roughened", "anisotropic", "anisotropic, roughened"])
def model(request, models):
    return models[request.param]


def test_is_reciprocal_finite_and_dark_below_the_horizon(model):
    w_i, w_o = random_directions(5000, 1, least_cos=-1), random_directions(5000, 2, least_cos=-1)
    values = model.evaluate(w_i, w_o)
    assert model.reciprocal
    np.testing.assert_allclose(values, model.evaluate(w_o, w_i), rtol=1e-12)
    assert np.all(np.isfinite(values))
    assert np.all(values >= 0)
    below = (w_i[:, 2] <= 0) | (w_o[:, 2] <= 0)
    assert not values[below].any()
    assert np.all(values[~below] > 0)


def test_stays_finite_at_the_horizon(model):
    cos = np.array([1e-300, 1e-30, 1e-9, 1e-3, 1.0])
    theta = np.arccos(cos)
    w = direction(theta, np.linspace(0, 5, 5))
    w[:, 2] = cos
    for w_o in w:
        views = np.tile(w_o, (5, 1))
        assert np.all(np.isfinite(model.evaluate(w, views)))
        assert np.all(np.isfinite(model.pdf(w, views)))


def sphere(rows):
    """Midpoints, solid angles: equal areas over cos(theta) and phi."""
    cos = (np.arange(rows) + 0.5) / rows * 2 - 1
    phi = (np.arange(2 * rows) + 0.5) / rows * np.pi
    theta, phi = (angle.ravel() for angle in np.meshgrid(np.arccos(cos), phi, indexing="ij"))
    return direction(theta, phi), 2 * np.pi / rows**2


def test_the_density_integrates_to_one_over_the_sphere(model):
    """Summed over upper half vectors: each direction of the sphere is the mirror image at one of them.

    d omega_i = 4 |o.h| d omega_h cancels what the density has of a pole at w_i = -o.
    """
    count, columns = 1000, 720
    theta, phi = np.meshgrid(
        ((np.arange(count) + 0.5) / count) ** 2 * np.pi / 2, (np.arange(columns) + 0.5) / columns * 2 * np.pi
    )
    theta, phi = theta.ravel(), phi.ravel()
    half = direction(theta, phi)
    solid_angle = np.sin(theta) * np.sqrt(theta * 2 * np.pi) / count * 2 * np.pi / columns
    for w_o in (direction(0.3, 0.4), direction(1.3, 0.4)):
        cos_d = half @ w_o
        density = model.pdf(2 * cos_d[:, None] * half - w_o, np.tile(w_o, (len(half), 1)))
        assert np.sum(density * 4 * np.abs(cos_d) * solid_angle) == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("theta_o", [0.3, 1.3])
def test_samples_have_exactly_the_density(model, theta_o):
    """A chi-square test over 200 patches of the sphere, those below the horizon included."""
    count, rows, fine = 100_000, 10, 700
    w_o = np.tile(direction(theta_o, 0.4), (count, 1))
    w_i = model.sample(w_o, np.random.default_rng(5).random((count, 3)))
    np.testing.assert_allclose(np.linalg.norm(w_i, axis=1), 1, atol=1e-9)
    at_row = np.minimum(((w_i[:, 2] + 1) / 2 * rows).astype(int), rows - 1)
    at_column = (np.arctan2(w_i[:, 1], w_i[:, 0]) / (2 * np.pi) % 1 * 2 * rows).astype(int) % (2 * rows)
    observed = np.bincount(at_row * 2 * rows + at_column, minlength=2 * rows * rows)
    directions, solid_angle = sphere(fine)
    pdf = model.pdf(directions, np.tile(w_o[0], (len(directions), 1)))
    patches = pdf.reshape(rows, fine // rows, 2 * rows, fine // rows).sum(axis=(1, 3)).ravel() * solid_angle
    expected = patches / patches.sum() * count
    rare = expected < 20
    merged = np.append(observed[~rare], observed[rare].sum()), np.append(expected[~rare], expected[rare].sum())
    assert chisquare(*merged).pvalue > 1e-3


def test_sampled_estimates_are_the_integral(model):
    """The albedo by samples of the model and by a sum over the sphere."""
    count = 200_000
    w_o = np.tile(direction(0.6, 0.4), (count, 1))
    w_i = model.sample(w_o, np.random.default_rng(3).random((count, 3)))
    weights = model.evaluate(w_i, w_o)[:, 1] * np.maximum(w_i[:, 2], 0) / model.pdf(w_i, w_o)
    directions, solid_angle = sphere(500)
    values = model.evaluate(directions, np.tile(w_o[0], (len(directions), 1)))[:, 1]
    expected = np.sum(values * np.maximum(directions[:, 2], 0)) * solid_angle
    assert np.mean(weights) == pytest.approx(expected, abs=4 * np.std(weights) / np.sqrt(count) + 1e-3 * expected)


@pytest.mark.parametrize("stretch", [(1.0, 1.0), (0.5, 1.0), (2.0, 1.0), (1.5, 0.7)])
def test_roughening_ggx_gives_ggx(stretch):
    """Eq. 9 on slopes of GGX with alpha 0.35: shadowing follows without a new table."""
    theta, cos_k = isotropic.nodes(90), isotropic.area_nodes(90)
    surface = Surface("ggx", 0.35)
    theta_k = np.arccos(cos_k)
    tables = theta, surface.slope_pdf(np.tan(theta), 0.0), theta_k, surface.shadowing(direction(theta_k))
    model = TabulatedMicrofacet(*tables, np.ones((90, 3))).roughened(*stretch)
    expected = Surface("ggx", 0.35 * stretch[0], 0.35 * stretch[1])
    w_i, w_o = random_directions(2000, 1), random_directions(2000, 2)
    np.testing.assert_allclose(model.evaluate(w_i, w_o), expected.brdf(w_i, w_o), rtol=5e-3)


def test_roughening_twice_is_roughening_by_the_product(models):
    w_i, w_o = random_directions(100, 1), random_directions(100, 2)
    for name in ("isotropic", "anisotropic"):
        twice = models[name].roughened(2.0, 0.5).roughened(0.5, 3.0)
        np.testing.assert_allclose(
            twice.evaluate(w_i, w_o), models[name].roughened(1.0, 1.5).evaluate(w_i, w_o), rtol=1e-9
        )


def test_a_saved_model_is_the_same_model(model, tmp_path):
    save(model, tmp_path / "model.npz")
    loaded = load(tmp_path / "model.npz").model
    w_i, w_o = random_directions(500, 1), random_directions(500, 2)
    u = np.random.default_rng(1).random((500, 3))
    assert type(loaded) is type(model)
    assert loaded.floats == model.floats
    assert loaded.fit_seconds == model.fit_seconds
    np.testing.assert_array_equal(loaded.evaluate(w_i, w_o), model.evaluate(w_i, w_o))
    np.testing.assert_array_equal(loaded.sample(w_o, u), model.sample(w_o, u))
    np.testing.assert_array_equal(loaded.pdf(w_i, w_o), model.pdf(w_i, w_o))


def test_an_isotropic_model_is_6_n_numbers(models):
    assert models["isotropic"].floats == models["published"].floats == 6 * 90
    assert {"P", "D", "G1", "F", "Q", "theta"} <= set(models["isotropic"].arrays())
    assert models["isotropic"].cost_ns() > 0
