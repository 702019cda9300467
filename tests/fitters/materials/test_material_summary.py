import dataclasses
import json

import numpy as np
import pytest

from fitters import grid
from fitters.materials import load_material, summarise
from fitters.materials.material import from_samples
from fitters.materials.summary import directional_albedo, hemispherical_albedo


def material(function):
    """A material whose samples (n, 3) are a function of w_i and w_o (n, 3)."""
    w_i, w_o = grid.cell_directions()
    samples = np.broadcast_to(function(w_i, w_o), (grid.CELLS, 3)).T.reshape(3, *grid.SHAPE)
    return from_samples("made", samples, source="test", sha256="0")


def test_the_albedo_of_a_lambertian_is_its_own():
    rho = np.array([0.1, 0.5, 0.9])
    lambertian = material(lambda w_i, w_o: rho / np.pi)
    albedo = directional_albedo(lambertian, np.radians([0, 30, 60, 80]))
    np.testing.assert_allclose(albedo, np.tile(rho, (4, 1)), rtol=0.01)
    np.testing.assert_allclose(hemispherical_albedo(lambertian), rho, rtol=0.01)


def test_the_albedo_follows_a_closed_form_that_varies_with_direction():
    # f = cos_i cos_o: the albedo is cos_i times the integral of cos_o^2, 2 pi / 3.
    cosines = material(lambda w_i, w_o: w_i[:, 2:] * w_o[:, 2:])
    theta = np.radians([0, 45, 75])
    expected = np.cos(theta) * 2 * np.pi / 3
    np.testing.assert_allclose(directional_albedo(cosines, theta)[:, 0], expected, rtol=0.01)
    np.testing.assert_allclose(hemispherical_albedo(cosines), 4 * np.pi / 9, rtol=0.01)


def test_the_narrowest_highlight_is_not_missed():
    # f = D(h) / (4 cos_d cos_o + 4 cos_d cos_i) * 2, which reflects all light from the zenith.
    width = np.radians(0.5)

    def mirror(w_i, w_o):
        half = (w_i + w_o) / np.linalg.norm(w_i + w_o, axis=1, keepdims=True)
        slope2 = (1 - half[:, 2:] ** 2) / half[:, 2:] ** 2
        ndf = np.exp(-slope2 / width**2) / (np.pi * width**2 * half[:, 2:] ** 4)
        return ndf / (4 * np.sum(w_i * half, axis=1, keepdims=True) ** 2)

    np.testing.assert_allclose(directional_albedo(material(mirror), np.zeros(1)), 1, rtol=0.01)


def test_counts_what_was_left_out_and_set_to_zero():
    samples = np.full((3, *grid.SHAPE), 0.25)
    samples[0, 0] = np.nan
    samples[2, 1] = -1
    summary = summarise(from_samples("made", samples, source="test", sha256="0"))
    above = grid.above_horizon()
    assert summary.cells == 1_458_000
    assert summary.above_horizon == above.sum()
    assert summary.valid == above.sum() - above[0].sum()
    assert summary.invalid_share == pytest.approx(above[0].sum() / above.sum())
    assert summary.negative_share == pytest.approx((0, 0, above[1].sum() / summary.valid))
    assert (summary.minimum, summary.median, summary.maximum) == ((0.25, 0.25, 0), (0.25,) * 3, (0.25,) * 3)


def test_tells_when_more_light_leaves_than_arrives():
    assert not summarise(material(lambda w_i, w_o: 0.97 / np.pi)).gains_energy
    assert summarise(material(lambda w_i, w_o: 1.05 / np.pi)).gains_energy


def test_a_summary_is_plain_data():
    summary = summarise(load_material("builtin:rough-plastic"))
    text = json.dumps(dataclasses.asdict(summary), allow_nan=False)
    assert json.loads(text)["directional_albedo"][1]["theta_i"] == 45
