"""The light in rings about the view, against closed forms and other maps of the same light."""

import numpy as np
import pytest

from fitters.scenes import EnvironmentMap
from fitters.scenes.rings import ring_energies

COUNT = 90


@pytest.fixture(scope="module")
def noise():
    return EnvironmentMap(np.random.default_rng(1).exponential(size=(12, 24, 3)))


def test_rings_of_a_constant_light_are_their_solid_angles():
    rings = ring_energies(EnvironmentMap(np.ones((8, 16, 3))), COUNT)
    expected = 2 * np.pi * -np.diff(np.cos(np.arange(COUNT + 1) / COUNT * np.pi))
    np.testing.assert_allclose(rings, np.tile(expected[:, None], 3), rtol=1e-3)


def test_all_rings_together_hold_all_light(noise):
    np.testing.assert_allclose(ring_energies(noise, 7, degrees=33.0).sum(axis=0), noise.power(), rtol=1e-6)


def test_the_same_light_on_a_finer_map_has_the_same_rings(noise):
    finer = EnvironmentMap(np.repeat(np.repeat(noise.radiance, 3, axis=0), 3, axis=1))
    rings = ring_energies(noise, COUNT)
    np.testing.assert_allclose(ring_energies(finer, COUNT), rings, atol=1e-4 * rings.max())


def test_rings_agree_with_directions_drawn_at_random(noise):
    rng = np.random.default_rng(2)
    w = rng.normal(size=(400_000, 3))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    row = (np.arccos(w[:, 1]) / np.pi * 12).astype(int)
    column = (np.arctan2(w[:, 0], -w[:, 2]) % (2 * np.pi) / np.pi * 12).astype(int)
    ring = (np.arccos(w[:, 2]) / np.pi * 9).astype(int)
    drawn = np.stack([np.bincount(ring, noise.radiance[row, column, c], 9) for c in range(3)], axis=1)
    np.testing.assert_allclose(ring_energies(noise, 9), drawn * 4 * np.pi / len(w), rtol=0.03)


def test_a_turned_light_is_that_of_the_turned_map(noise):
    # By three texels, which resamples nothing.
    turned = ring_energies(noise.rotated(45.0), COUNT)
    np.testing.assert_allclose(ring_energies(noise, COUNT, degrees=45.0), turned, atol=1e-9 * turned.max())
    assert not np.allclose(ring_energies(noise, COUNT), turned, rtol=0.01)


def test_one_texel_lights_the_rings_that_it_lies_in():
    radiance = np.zeros((12, 24, 3))
    radiance[5, 14] = 1.0, 2.0, 4.0
    light = EnvironmentMap(radiance)
    corners = np.array([[5, 14], [5, 15], [6, 14], [6, 15]]) / 12 * np.pi
    angles = np.degrees(np.arccos(-np.sin(corners[:, 0]) * np.cos(corners[:, 1])))
    rings = ring_energies(light, 180)
    assert np.all(rings >= 0)
    lit = np.flatnonzero(rings[:, 0])
    assert lit.min() == int(angles.min())
    # The farthest point of a texel is a corner; the nearest one may lie between two.
    assert lit.max() == int(angles.max())
    np.testing.assert_allclose(ring_energies(light, 180).sum(axis=0), light.power(), rtol=1e-9)
