"""The anisotropic extraction on surfaces whose Sigma is known."""

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.materials import utia
from fitters.materials.material_file import MaterialFile
from fitters.models.power_iterations import Settings, anisotropic, extract, extract_anisotropic, isotropic
from tests.fitters.models.power_iterations.closed_forms import Surface, direction, material, random_directions

BECKMANN = Surface("beckmann", 0.3, 0.15, 0.5, fresnel=(0.7, 0.5, 0.3))
GGX = Surface("ggx", 0.4, 0.15, 1.2, fresnel=(0.7, 0.5, 0.3))


@pytest.fixture(scope="module")
def beckmann():
    return extract_anisotropic(BECKMANN.brdf)


@pytest.fixture(scope="module")
def ggx():
    return extract_anisotropic(GGX.brdf)


def test_roughness_and_rotation_are_recovered(beckmann, ggx):
    np.testing.assert_allclose(beckmann.alpha_beckmann, BECKMANN.alphas, rtol=2e-3)
    np.testing.assert_allclose(ggx.alpha_ggx, GGX.alphas, rtol=0.01)
    for extraction in (beckmann, ggx):
        np.testing.assert_allclose(extraction.fresnel_at_normal, (0.7, 0.5, 0.3), rtol=0.03)


@pytest.mark.parametrize("turn", [0.0, 0.9, -0.9])
def test_rotation_is_recovered_with_its_sign(turn):
    surface = Surface("ggx", 0.3, 0.12, turn)
    found = extract_anisotropic(surface.brdf, Settings(resolution=60, azimuths=60))
    np.testing.assert_allclose(found.alpha_ggx, surface.alphas, rtol=0.01, atol=0.01)


@pytest.mark.parametrize("name", ["beckmann", "ggx"])
def test_distribution_and_shadowing_have_their_closed_form(name, request):
    model, surface = request.getfixturevalue(name).model, {"beckmann": BECKMANN, "ggx": GGX}[name]
    phi = anisotropic.azimuths(90)[:, None]
    expected = surface.ndf(direction(model.theta, phi))
    seen = expected > 1e-6 * expected.max()
    np.testing.assert_allclose(model.ndf[seen], expected[seen], rtol=5e-3)
    np.testing.assert_allclose(model.shadowing, surface.shadowing(direction(model.theta_k, phi)), rtol=0.01)


def test_the_model_evaluates_to_the_closed_form(ggx):
    w_i, w_o = random_directions(2000, 1), random_directions(2000, 2)
    expected = GGX.brdf(w_i, w_o)
    deviation = np.abs(ggx.model.evaluate(w_i, w_o) / expected - 1)
    assert np.median(deviation) < 0.01
    assert np.quantile(deviation, 0.99) < 0.1


def test_harmonics_are_the_matrix_of_equation_17():
    columns, count = 12, 8
    f_r = np.random.default_rng(1).uniform(0.5, 1.5, (columns, count))
    phi, theta = (
        a.ravel() for a in np.meshgrid(anisotropic.azimuths(columns), isotropic.nodes(count), indexing="ij")
    )
    o = direction(theta, phi)
    facing = np.maximum(o @ o.T, 0.0)
    # d omega = sin d theta d phi with theta = u^2 pi / 2.
    weight = np.sin(theta) * np.sqrt(theta * 2 * np.pi) / count * 2 * np.pi / columns
    matrix = (4 * f_r.ravel() * o[:, 2] ** 5)[:, None] * facing * (weight / o[:, 2] ** 4)
    values, vectors = np.linalg.eig(matrix)
    expected = np.abs(vectors[:, np.argmax(values.real)].real)
    found = anisotropic.dominant(f_r, 200, 1e-12).values
    np.testing.assert_allclose(found.ravel(), expected / expected.max(), rtol=1e-8)


def test_an_isotropic_material_gives_the_isotropic_result():
    table = material(Surface("ggx", 0.3, fresnel=(0.9, 0.6, 0.3)).brdf)
    both = extract(table), extract_anisotropic(table)
    alpha_x, alpha_y, rho = both[1].alpha_ggx
    assert alpha_x == pytest.approx(both[0].alpha_ggx, rel=0.01)
    assert alpha_y == pytest.approx(both[0].alpha_ggx, rel=0.01)
    assert rho == pytest.approx(0, abs=1e-3)
    np.testing.assert_allclose(both[1].model.slope_pdf.mean(axis=0), both[0].model.slope_pdf, rtol=0.02)


def utia_file(surface):
    theta, phi = np.radians(np.arange(6) * 15.0), np.radians(np.arange(48) * 7.5)
    w = direction(theta[:, None], phi).reshape(-1, 3)
    samples = surface.brdf(np.repeat(w, 288, axis=0), np.tile(w, (288, 1))).T.reshape(3, 288, 288)
    return utia.load(MaterialFile("cloth.bin", "cloth", samples.astype("<f8").tobytes()))


def test_a_utia_file_is_extracted():
    """Beckmann, rough enough for steps of 15 degrees and without slopes beyond the last, 75 degrees."""
    surface = Surface("beckmann", 0.6, 0.4, 0.5, fresnel=(0.7, 0.5, 0.3))
    found = extract_anisotropic(utia_file(surface))
    np.testing.assert_allclose(found.alpha_beckmann, surface.alphas, rtol=0.05)


def test_slopes_beyond_utia_s_last_elevation_are_lost():
    """A heavy tail comes out too smooth: what 75 degrees cut off is not in the file."""
    surface = Surface("ggx", 0.8, 0.4)
    found = extract_anisotropic(utia_file(surface)).alpha_ggx
    assert np.all(np.array(found[:2]) < surface.alphas[:2])
    np.testing.assert_allclose(found[:2], surface.alphas[:2], rtol=0.2)


def test_what_cannot_be_extracted_is_refused():
    with pytest.raises(FittersError, match="backscattering is 0 in every direction"):
        extract_anisotropic(lambda w_i, w_o: np.zeros((len(w_i), 3)))
    with pytest.raises(FittersError, match="NaN"):
        extract_anisotropic(lambda w_i, w_o: np.full((len(w_i), 3), np.nan))
    with pytest.raises(FittersError, match="reference settings"):
        extract_anisotropic(GGX.brdf, Settings.reference())
