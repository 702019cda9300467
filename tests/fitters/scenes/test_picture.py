"""Pictures of the sphere: they agree with the light table, which renders by another program confirm."""

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.grid import SHAPE
from fitters.materials import load_material
from fitters.scenes import Scene, light_table
from fitters.scenes.kernel import sphere_normals
from fitters.scenes.lights import load_light
from fitters.scenes.picture import pictures

SCENE = Scene(light="studio", resolution=24, light_rows=24)


@pytest.fixture(scope="module")
def light():
    return load_light("studio").resampled(SCENE.light_rows, 0.0)


def test_the_mean_of_a_picture_is_what_the_light_table_says(light):
    tables = np.stack([load_material(f"builtin:{name}").table for name in ("metal", "fabric")])
    found = pictures(light, SCENE.resolution, tables).mean(axis=1)
    expected = np.einsum("chdp,mchdp->mc", light_table(SCENE).table.astype(float), tables)
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_a_matte_sphere_shows_the_irradiance_of_every_pixel(light):
    found = pictures(light, 16, np.full((1, 3, *SHAPE), 1 / np.pi, np.float32))[0]
    cosine = np.maximum(sphere_normals(16) @ light.directions().reshape(-1, 3).T, 0)
    emission = (light.radiance * light.solid_angles()[..., None]).reshape(-1, 3)
    np.testing.assert_allclose(found, cosine @ emission / np.pi, rtol=1e-5)


def test_tables_of_another_shape_are_refused(light):
    with pytest.raises(FittersError, match="pictures take tables"):
        pictures(light, 8, np.zeros((3, *SHAPE)))
