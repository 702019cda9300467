"""The procedural lights."""

import numpy as np
import pytest

from fitters.scenes import load_light
from fitters.scenes.lights import overcast, studio


def test_studio_is_a_high_dynamic_range_light_of_several_colours():
    light = load_light("studio").radiance
    assert light.max() / np.median(light) > 100
    red, green, blue = load_light("studio").power()
    assert red > 1.02 * green > 1.02 * blue


def test_the_studio_key_stands_up_left_and_before_the_sphere():
    light = studio(64)
    row, column = np.unravel_index(np.argmax(light.radiance[..., 0] * (light.directions()[..., 2] > 0)), (64, 128))
    x, y, z = light.directions()[row, column]
    assert x < 0 < y
    assert z > 0


def test_overcast_sky_lights_the_ground_as_moon_and_spencer_say():
    light = overcast(256)
    up = np.clip(light.directions()[..., 1], 0, None)
    irradiance = np.sum(light.radiance * (up * light.solid_angles())[..., None], axis=(0, 1))
    np.testing.assert_allclose(irradiance, 7 * np.pi / 9, rtol=1e-4)
    assert light.radiance[0, 0, 0] == pytest.approx(3 * light.radiance[127, 0, 0], rel=0.02)


@pytest.mark.parametrize("light", [studio, overcast])
def test_resolution_hardly_matters(light):
    np.testing.assert_allclose(light(256).power(), light(512).power(), rtol=2e-3)
