"""The image map against Mitsuba 3, which has its own maps, camera, sampling and BRDFs."""

import numpy as np
import pytest

from fitters.expressions.evaluation import features
from fitters.grid import CELLS, cell_directions
from fitters.materials import load_material
from fitters.scenes.environment import EnvironmentMap
from fitters.scenes.geometry import sphere
from fitters.scenes.lights import studio
from tests.fitters.rendering.test_image_map import image_of
from tests.reference_scene import SHARED

PIXELS, LIGHT_ROWS, SAMPLES = 16, 24, 2048
FINER = 4
"""Mitsuba averages over a pixel, a map is of pixels' centres: so many times so many are averaged."""
RGL = SHARED / "data/rgl/satin_purple_rgb.bsdf"


@pytest.fixture(scope="module")
def mitsuba():
    module = pytest.importorskip("mitsuba")
    before = module.variant()
    module.set_variant("scalar_rgb")
    yield module
    if before:
        module.set_variant(before)


def rendered(mi, light, bsdf):
    """Mitsuba's image (PIXELS, PIXELS, 3) of the unit sphere, row 0 at the top, texels of the light constant."""
    fine = np.repeat(np.repeat(light.radiance, 16, axis=0), 16, axis=1)
    scene = {
        "type": "scene",
        "integrator": {"type": "direct", "hide_emitters": True},
        "sensor": {
            "type": "orthographic",
            "to_world": mi.ScalarTransform4f().look_at(origin=[0, 0, 4], target=[0, 0, 0], up=[0, 1, 0]),
            "film": {"type": "hdrfilm", "width": PIXELS, "height": PIXELS, "rfilter": {"type": "box"}},
            "sampler": {"type": "multijitter", "sample_count": SAMPLES},
        },
        "sphere": {"type": "sphere", "bsdf": bsdf},
        "light": {"type": "envmap", "bitmap": mi.Bitmap(fine.astype(np.float32))},
    }
    return np.array(mi.render(mi.load_dict(scene)))[:, :, :3].astype(np.float64)


def mapped(light, values):
    """Our image (PIXELS, PIXELS, 3) for BRDF values (CELLS, 3), and which pixels lie well inside the sphere."""
    geometry = sphere(PIXELS * FINER)
    seen = image_of(light, geometry)
    image, facing = np.zeros(((PIXELS * FINER) ** 2, 3)), np.zeros((PIXELS * FINER) ** 2)
    image[geometry.pixels] = seen.radiance(values[seen.cells])
    facing[geometry.pixels] = geometry.normals[:, 2]
    blocks = (PIXELS, FINER, PIXELS, FINER)
    return image.reshape(*blocks, 3).mean(axis=(1, 3)), facing.reshape(blocks).min(axis=(1, 3)) > 0.4


def assert_same_image(mi, bsdf, values):
    light = EnvironmentMap(studio(LIGHT_ROWS).radiance)
    ours, inside = mapped(light, values)
    theirs = rendered(mi, light, bsdf)[inside]
    difference = ours[inside] - theirs
    # What is left is Mitsuba's noise, and a BRDF that is constant in a cell: denser samples change nothing.
    assert np.linalg.norm(difference) < 0.02 * np.linalg.norm(theirs)
    assert np.quantile(np.abs(difference) / theirs, 0.9) < 0.05
    assert np.abs(difference.mean()) < 0.007 * theirs.mean()


def rough_conductor(alpha):
    """D G / (4 cos cos) of GGX with Smith's separable G (Walter et al. 2007), Fresnel term 1, at all cells."""
    w_i, w_o = cell_directions()
    above = (w_i[:, 2] > 0) & (w_o[:, 2] > 0)
    seen = features(w_i[above], w_o[above])
    d = alpha**2 / (np.pi * (seen["wh.z"] ** 2 * (alpha**2 - 1) + 1) ** 2)

    def g1(cosine):
        return 2 / (1 + np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)))

    values = np.zeros((CELLS, 3))
    i, o = seen["wi.z"], seen["wo.z"]
    values[above] = (d * g1(i) * g1(o) / (4 * i * o))[:, None]
    return values


def test_a_sharp_conductor(mitsuba):
    bsdf = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": 0.05}
    assert_same_image(mitsuba, bsdf, rough_conductor(0.05))


@pytest.mark.skipif(not RGL.exists(), reason=f"no measurement {RGL}")
def test_a_measured_material(mitsuba):
    material = load_material(RGL)
    values = material.table.reshape(3, CELLS).T.astype(np.float64)
    assert_same_image(mitsuba, {"type": "measured", "filename": str(RGL)}, values)
