"""From whole materials to results, and what is said of materials that do not suit the method."""

import dataclasses

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.grid import bin_centres
from fitters.models.power_iterations import Settings, extract
from tests.fitters.models.power_iterations.closed_forms import Surface, material

SCHLICK = np.array([0.9, 0.5, 0.1])


def schlick(w_i, w_o):
    cos_d = np.linalg.norm(w_i + w_o, axis=-1)[:, None] / 2
    return SCHLICK + (1 - SCHLICK) * (1 - cos_d) ** 5


def beckmann(w_i, w_o):
    return Surface("beckmann", 0.4).brdf(w_i, w_o) * schlick(w_i, w_o)


@pytest.fixture(scope="module")
def smooth():
    return material(beckmann)


def changed(original, valid):
    return dataclasses.replace(original, valid=valid, table=np.where(valid, original.table, 0).astype(np.float32))


def test_the_fresnel_term_is_found(smooth):
    """Near grazing, the backscattering at theta_diff 0.5 degrees has eq. 2's G, which the method takes for G1."""
    found = extract(smooth)
    cos_d = np.cos(bin_centres()[1])[:, None]
    expected = SCHLICK + (1 - SCHLICK) * (1 - cos_d) ** 5
    np.testing.assert_allclose(found.fresnel[:70], expected[:70], rtol=0.03)
    np.testing.assert_allclose(found.fresnel_at_normal, SCHLICK, rtol=0.03)
    assert found.alpha_beckmann == pytest.approx(0.4, rel=0.02)
    assert found.warnings == ()
    assert found.model.fit_seconds > 0


def test_luminance_alone_decides_the_distribution(smooth):
    """One distribution for all channels: only those with weight in the luminance move it."""
    grey = material(lambda w_i, w_o: beckmann(w_i, w_o) @ np.array([[0.2126], [0.7152], [0.0722]]) * np.ones(3))
    np.testing.assert_allclose(extract(grey).model.slope_pdf, extract(smooth).model.slope_pdf, rtol=1e-4)


@pytest.mark.parametrize("count", [30, 90, 200])
def test_the_resolution_may_differ_from_the_grid(smooth, count):
    found = extract(smooth, Settings(resolution=count))
    assert len(found.model.slope_pdf) == count
    assert found.alpha_beckmann == pytest.approx(0.4, rel=0.03)


def test_invalid_backscattering_is_filled_in(smooth):
    valid = smooth.valid.copy()
    valid[20:24, 0] = False
    valid[85:, 0] = False
    valid[10, 0, :100] = False
    found = extract(changed(smooth, valid))
    assert any("9 of 90 theta_half bins" in warning for warning in found.warnings)
    assert found.alpha_beckmann == pytest.approx(extract(smooth).alpha_beckmann, rel=0.02)


def test_a_material_without_backscattering_is_refused(smooth):
    valid = smooth.valid.copy()
    valid[:, 0] = False
    with pytest.raises(FittersError, match=r"closed form: no cell with theta_diff below 1 degree.*fit a formula"):
        extract(changed(smooth, valid))
    dark = smooth.table.copy()
    dark[:, :, 0] = 0
    for settings in (Settings(), Settings.reference()):
        with pytest.raises(FittersError, match="backscattering is 0 in every direction"):
            extract(dataclasses.replace(smooth, table=dark), settings)


def test_residuals_and_heavy_tails_are_said():
    """A Lambertian part goes into the tail of the distribution, forward scattering into a Fresnel term above 1."""

    def rubber(w_i, w_o):
        return Surface("ggx", 0.5, fresnel=(0.05,) * 3).brdf(w_i, w_o) + 0.4 / np.pi

    def sheen(w_i, w_o):
        return beckmann(w_i, w_o) * (1 + 20 * (1 - np.linalg.norm(w_i + w_o, axis=-1)[:, None] / 2))

    assert any("mean squared slope" in warning for warning in extract(material(rubber)).warnings)
    assert any("Fresnel term exceeds 1" in warning for warning in extract(material(sheen)).warnings)


def test_cells_that_send_nothing_back_are_kept(smooth):
    """Isolated zeros are measurements: P is 0 there, and everything stays finite."""
    table = smooth.table.copy()
    table[:, 30, 0] = 0
    found = extract(dataclasses.replace(smooth, table=table))
    assert found.model.slope_pdf[30] == 0
    assert np.isfinite(found.alpha_beckmann)
    assert np.all(np.isfinite(found.fresnel))


def test_settings_that_make_no_table_are_refused():
    with pytest.raises(FittersError, match="resolution is 3"):
        Settings(resolution=3)
    with pytest.raises(FittersError, match="iterations is 0"):
        Settings(iterations=0)
