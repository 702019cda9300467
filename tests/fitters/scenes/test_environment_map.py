"""Environment maps: geometry of texels, exact reduction, rotation."""

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.scenes import EnvironmentMap


def random_map(rows, seed=0):
    return EnvironmentMap(np.random.default_rng(seed).exponential(size=(rows, 2 * rows, 3)))


def test_texels_tile_the_sphere_of_directions():
    light = random_map(12)
    assert 24 * light.solid_angles().sum() == pytest.approx(4 * np.pi, rel=1e-14)
    np.testing.assert_allclose(np.linalg.norm(light.directions(), axis=-1), 1, atol=1e-14)


def test_azimuth_runs_from_minus_z_over_plus_x():
    directions = random_map(16).directions()
    assert directions[0, :, 1].min() > 0.99
    assert directions[8, 0, 2] < -0.9
    assert directions[8, 8, 0] > 0.9
    assert directions[8, 16, 2] > 0.9


@pytest.mark.parametrize("rows", [24, 8, 7, 5, 36, 1])
@pytest.mark.parametrize("degrees", [0.0, 33.3])
def test_resampling_preserves_total_power(rows, degrees):
    light = random_map(24)
    np.testing.assert_allclose(light.resampled(rows, degrees).power(), light.power(), rtol=1e-9)


@pytest.mark.parametrize("rows", [8, 7, 36])
def test_resampling_preserves_a_constant(rows):
    constant = EnvironmentMap(np.full((24, 48, 3), 2.5))
    np.testing.assert_allclose(constant.resampled(rows, 12.3).radiance, 2.5, rtol=1e-12)


def test_reduction_by_a_whole_factor_is_the_weighted_average_of_blocks():
    light = random_map(12)
    weights = np.broadcast_to(light.solid_angles(), (12, 24))
    blocks = (light.radiance * weights[..., None]).reshape(4, 3, 8, 3, 3).sum(axis=(1, 3))
    expected = blocks / weights.reshape(4, 3, 8, 3).sum(axis=(1, 3))[..., None]
    np.testing.assert_allclose(light.reduced(4).radiance, expected, rtol=1e-12)


def test_reduction_splits_a_texel_by_the_area_it_shares():
    radiance = np.zeros((3, 6, 3))
    radiance[1, 1] = 1.0
    # Of 3 x 6 texels onto 2 x 4: this one spans theta from 60 to 120 and phi from 60 to 120 degrees, and is
    # therefore cut into quarters; each of the four new texels has a solid angle of pi / 2.
    share = (np.pi / 3) * 1.0 / 4 / (np.pi / 2)
    expected = np.zeros((2, 4))
    expected[:, :2] = share
    np.testing.assert_allclose(EnvironmentMap(radiance).reduced(2).radiance[..., 0], expected, atol=1e-15)


@pytest.mark.parametrize("columns", [1, 5, 17, -3])
def test_rotation_by_whole_columns_rolls_the_map(columns):
    light = random_map(9)
    turned = light.rotated(columns * 20.0)
    np.testing.assert_allclose(turned.radiance, np.roll(light.radiance, -columns, axis=1), rtol=1e-12)


def test_rotation_by_columns_of_the_reduced_map_rolls_the_reduced_map():
    light = random_map(32)
    rolled = np.roll(light.reduced(12).radiance, -7, axis=1)
    np.testing.assert_allclose(light.resampled(12, 7 * 15.0).radiance, rolled, rtol=1e-8)


def test_rotation_leaks_nothing_through_rounding():
    radiance = np.zeros((7, 14, 3))
    radiance[3, 2] = 1.0
    for column in range(14):
        assert np.count_nonzero(EnvironmentMap(radiance).rotated(column * 360 / 14).radiance) == 3


def test_positive_rotation_takes_light_behind_the_camera_to_its_right():
    radiance = np.zeros((8, 16, 3))
    radiance[4, 8] = 1.0
    light = EnvironmentMap(radiance)

    def centroid(light):
        weights = light.radiance[..., 0] * light.solid_angles()
        return np.einsum("rc,rcx->x", weights, light.directions()) / weights.sum()

    x, y, z = centroid(light)
    turned = centroid(light.rotated(90.0))
    np.testing.assert_allclose(turned, [z, y, -x], atol=1e-14)
    assert turned[0] > 0.9


@pytest.mark.parametrize(
    ("radiance", "message"),
    [
        (np.ones((4, 9, 3)), "not \\(rows, 2 rows, 3\\)"),
        (np.ones((4, 8)), "not \\(rows, 2 rows, 3\\)"),
        (np.ones((4, 8, 3), np.float32), "float32"),
        (np.zeros((4, 8, 3)), "black"),
        (np.full((4, 8, 3), np.nan), "96 values are negative or not finite"),
        (np.full((4, 8, 3), -1.0), "96 values are negative or not finite"),
    ],
)
def test_what_is_no_map_is_refused(radiance, message):
    with pytest.raises(FittersError, match=message):
        EnvironmentMap(radiance)
