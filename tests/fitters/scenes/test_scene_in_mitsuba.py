"""The scene rendered by Mitsuba 3, an independent renderer with its own maps, camera and BRDFs."""

import numpy as np
import pytest

from fitters.grid import SHAPE, cell_directions
from fitters.scenes.environment import EnvironmentMap
from fitters.scenes.geometry import sphere
from fitters.scenes.lights import studio
from fitters.scenes.sphere import sphere_light

PIXELS = 32
ROTATION = 40.0


@pytest.fixture(scope="module")
def mitsuba():
    module = pytest.importorskip("mitsuba")
    before = module.variant()
    module.set_variant("scalar_rgb")
    yield module
    if before:
        module.set_variant(before)


def render(mi, light: EnvironmentMap, bsdf, rotation):
    """Mean-preserving image (PIXELS, PIXELS, 3), row 0 at the bottom, of the unit sphere."""
    looking = mi.ScalarTransform4f().look_at(origin=[0, 0, 4], target=[0, 0, 0], up=[0, 1, 0])
    scene = {
        "type": "scene",
        "integrator": {"type": "direct", "hide_emitters": True},
        "sensor": {
            "type": "orthographic",
            "to_world": looking,
            "film": {"type": "hdrfilm", "width": PIXELS, "height": PIXELS, "rfilter": {"type": "box"}},
            "sampler": {"type": "multijitter", "sample_count": 144},
        },
        "sphere": {"type": "sphere", "bsdf": bsdf},
        "light": {
            "type": "envmap",
            "bitmap": mi.Bitmap(light.radiance.astype(np.float32)),
            "to_world": mi.ScalarTransform4f().rotate([0, 1, 0], rotation),
        },
    }
    return np.array(mi.render(mi.load_dict(scene)))[::-1, :, :3].astype(np.float64)


def sphere_mean(image):
    return image.sum(axis=(0, 1)) / (np.pi / 4 * PIXELS**2)


def test_a_lambertian_sphere(mitsuba):
    light, albedo = studio(64), np.array([0.8, 0.5, 0.2])
    bsdf = {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo.tolist()}}
    image = render(mitsuba, light, bsdf, ROTATION)
    turned, normals = light.rotated(ROTATION), sphere(PIXELS).normals

    table = sphere_light(turned)
    np.testing.assert_allclose(sphere_mean(image), albedo / np.pi * table.sum(axis=(1, 2, 3)), rtol=0.01)

    # Pixel by pixel: a mirrored camera, map or rotation would pass the mean but not this.
    cosines = np.clip(normals @ turned.directions().reshape(-1, 3).T, 0, None)
    emission = (turned.radiance * turned.solid_angles()[..., None]).reshape(-1, 3)
    expected = albedo / np.pi * (cosines @ emission)
    inside = np.hypot(*normals[:, :2].T) < 0.9
    at = ((normals[inside, :2] + 1) / 2 * PIXELS).astype(int)
    rendered = image[at[:, 1], at[:, 0]]
    assert np.sqrt(np.mean((rendered / expected[inside] - 1) ** 2)) < 0.03


def test_a_rough_conductor_seen_through_the_cells(mitsuba):
    mi, light = mitsuba, studio(32)
    bsdf = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": 0.5}
    image = render(mi, light, bsdf, 0.0)

    table = sphere_light(light)
    w_i, w_o = cell_directions()
    above = ((w_i[:, 2] > 0) & (w_o[:, 2] > 0)).reshape(SHAPE)
    cells = np.flatnonzero((table.sum(axis=0) > 0) & above)
    material, context = mi.load_dict(bsdf), mi.BSDFContext()
    values = np.zeros(len(cells))
    for i, cell in enumerate(cells):
        interaction = mi.SurfaceInteraction3f()
        interaction.wi = mi.Vector3f(w_o[cell])
        cosine = w_i[cell, 2]
        values[i] = material.eval(context, interaction, mi.Vector3f(w_i[cell]))[0] / cosine
    expected = (table.reshape(3, -1)[:, cells] * values).sum(axis=1)
    np.testing.assert_allclose(sphere_mean(image), expected, rtol=0.02)
