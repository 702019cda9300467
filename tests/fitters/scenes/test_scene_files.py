"""Geometry from Mitsuba scene files, against the built-in sphere and Mitsuba's own AOVs and shadows."""

import dataclasses
import sys

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.materials import load_material
from fitters.rendering import image_map
from fitters.rendering.maps import mapped
from fitters.scenes import Scene, geometries, light_table, load_light, sampled
from fitters.scenes.geometries import load_geometry
from fitters.scenes.geometry import sphere
from fitters.scenes.mitsuba_scene import mitsuba_geometry

PIXELS, ROWS = 32, 24
BALL = '<shape type="sphere" id="ball"/>'
LAMP = (
    '<shape type="sphere" id="lamp"><point name="center" x="0.9" y="0.9" z="1.1"/>'
    '<float name="radius" value="0.45"/>'
)
MATTE = '<bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.5, 0.2"/></bsdf>'


def camera(kind="orthographic", size=(PIXELS, PIXELS), scale=1.0, origin="0,0,4", extra=""):
    return (
        f'<sensor type="{kind}">{extra}<transform name="to_world"><scale x="{scale}" y="{scale}"/>'
        f'<lookat origin="{origin}" target="0,0,0" up="0,1,0"/></transform><film type="hdrfilm">'
        f'<integer name="width" value="{size[0]}"/><integer name="height" value="{size[1]}"/>'
        '<rfilter type="box"/></film></sensor>'
    )


@pytest.fixture(scope="module")
def mitsuba():
    module = pytest.importorskip("mitsuba")
    before = module.variant()
    module.set_variant("scalar_rgb")
    yield module
    if before:
        module.set_variant(before)


@pytest.fixture(scope="module")
def kernels():
    """Compiled code from the cache of all tests; geometry and images come from a fresh one."""
    light, ball = load_light("overcast").reduced(2), sphere(2)
    sampled.sampled_table(light, ball, ball, 2, tolerance=1e9)
    mapped(light, ball, 2)


@pytest.fixture(scope="module")
def metal():
    return load_material("builtin:metal")


@pytest.fixture
def write(kernels, tmp_path, monkeypatch):
    monkeypatch.setenv("GPSEARCH_CACHE", str(tmp_path / "cache"))
    # A twentieth of the samples that a table takes to converge.
    monkeypatch.setattr(geometries, "POINTS", 256)
    monkeypatch.setattr(sampled, "ROUNDS", 2)

    def write(*content):
        path = tmp_path / "scene.xml"
        path.write_text(f'<scene version="3.0.0">{"".join(content)}</scene>')
        return path

    return write


def image(geometry, values):
    """Values (p, ...) of a geometry's pixels as an image, NaN elsewhere."""
    found = np.full((geometry.shape[0] * geometry.shape[1], *values.shape[1:]), np.nan)
    found[geometry.pixels] = values
    return found.reshape(*geometry.shape, *values.shape[1:])


def test_a_sphere_in_a_scene_file_is_the_built_in_one(mitsuba, write):
    path = write(camera(), BALL)
    found, expected = mitsuba_geometry(path, PIXELS), sphere(PIXELS)
    order = np.argsort(expected.pixels)
    np.testing.assert_array_equal(found.pixels, expected.pixels[order])
    np.testing.assert_allclose(found.normals, expected.normals[order], atol=2e-5)
    np.testing.assert_allclose(found.views, expected.views, atol=1e-6)


@pytest.mark.long
def test_its_light_table_and_image_are_those_of_the_built_in_one(mitsuba, metal, write):
    """A convex body hides no light from itself: its table is as far from the closed form as it says."""
    analytic = Scene(resolution=PIXELS, light_rows=ROWS, rotation=30.0)
    scene = dataclasses.replace(analytic, geometry=str(write(camera(), BALL)))
    found, expected = light_table(scene), light_table(analytic)
    apart = [np.linalg.norm(a - b) / np.linalg.norm(b) for a, b in zip(found.table, expected.table, strict=True)]
    assert max(apart) == pytest.approx(found.distance, rel=0.1)
    assert not found.converged
    np.testing.assert_allclose(found.table.sum(axis=(1, 2, 3)), expected.table.sum(axis=(1, 2, 3)), rtol=0.01)
    first, second = (image_map(each).of_material(metal).pixels for each in (scene, analytic))
    np.testing.assert_allclose(first, second, atol=2e-3 * second.max())
    assert np.linalg.norm(first - second) < 1e-3 * np.linalg.norm(second)


def test_normals_and_views_are_mitsubas_own(mitsuba, write):
    """Its `aov` integrator averages a pixel's normals and positions; a few pixels lie across an edge."""
    path = write(
        camera("perspective", (48, 24), origin="1,2,5", extra='<float name="fov" value="50"/>'),
        BALL,
        LAMP,
        "</shape>",
    )
    aovs = {"type": "aov", "aovs": "n:sh_normal,at:position,t:depth"}
    rendered = np.array(
        mitsuba.render(mitsuba.load_file(str(path)), integrator=mitsuba.load_dict(aovs), spp=64), np.float64
    )
    geometry = mitsuba_geometry(path, 48)
    assert geometry.shape == (24, 48)
    normals, views = image(geometry, geometry.normals), image(geometry, geometry.views)
    towards = np.array([1, 2, 5]) - rendered[..., 3:6]
    whole = (rendered[..., 6] > 0) & (np.linalg.norm(rendered[..., :3], axis=-1) > 0.98)
    assert np.mean(np.isfinite(normals[whole])) > 0.97
    seen = whole & np.isfinite(normals[..., 0])
    assert np.sum(seen) > 100
    np.testing.assert_allclose(normals[seen], rendered[seen, :3], atol=0.05)
    towards = towards[seen] / np.linalg.norm(towards[seen], axis=-1, keepdims=True)
    np.testing.assert_allclose(views[seen], towards, atol=5e-3)


def test_one_sphere_shades_the_other_as_in_mitsuba(mitsuba, write):
    """Its `direct` integrator sees the sky and no light between the shapes, as the image map does.

    What remains is its noise: 1.6 % of the image here, 0.8 % at 4096 samples.
    """
    path = write(camera(scale=1.5), BALL[:-2] + ">", MATTE, "</shape>", LAMP, MATTE, "</shape>")
    light = load_light("overcast")
    lit = path.with_name("lit.xml")
    mitsuba.Bitmap(light.radiance.astype(np.float32)).write(str(path.with_name("sky.exr")))
    sky = '<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter></scene>'
    lit.write_text(path.read_text().replace("</scene>", sky))
    direct = mitsuba.load_dict({"type": "direct", "hide_emitters": True})
    rendered = np.array(mitsuba.render(mitsuba.load_file(str(lit)), integrator=direct, spp=1024), np.float64)[
        ..., :3
    ]

    scene = Scene("overcast", resolution=PIXELS, light_rows=ROWS, geometry=str(path))
    albedo = np.array([0.8, 0.5, 0.2])

    def picture(scene):
        seen = image_map(scene)
        return seen.picture(np.broadcast_to(albedo / np.pi, (len(seen.cells), 3)))

    shaded, bare = picture(scene), picture(dataclasses.replace(scene, shadows=False))
    # Pixels at a silhouette are a mixture in the one and a centre in the other.
    inner = shaded.foreground.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(shaded.foreground, step, axis)
    difference = shaded.pixels[inner] - rendered[inner]
    wrong = bare.pixels[inner] - rendered[inner]
    assert np.linalg.norm(difference) < 0.025 * np.linalg.norm(rendered[inner])
    assert np.linalg.norm(wrong) > 0.1 * np.linalg.norm(rendered[inner])
    assert np.all(bare.pixels >= 0.99 * shaded.pixels)
    # The table is the same sums, by cells.
    total = light_table(scene).table.sum(axis=(1, 2, 3)) * albedo / np.pi
    np.testing.assert_allclose(total, shaded.pixels[shaded.foreground].mean(axis=0), rtol=0.01)


def test_one_shape_may_have_the_material_while_others_hide_it(mitsuba, write):
    path = write(camera(scale=1.5), BALL, LAMP, "</shape>")
    both = mitsuba_geometry(path, PIXELS)
    parts = [mitsuba_geometry(path, PIXELS, shape=name) for name in ("ball", "lamp")]
    assert sorted(np.concatenate([part.pixels for part in parts])) == sorted(both.pixels)
    alone = mitsuba_geometry(write(camera(scale=1.5), BALL), PIXELS)
    assert set(parts[0].pixels) < set(alone.pixels)
    with pytest.raises(FittersError, match=r"scene.xml: has no shape of id 'lid'; there are ball"):
        mitsuba_geometry(path, PIXELS, shape="lid")


def test_a_surface_has_two_sides(mitsuba, write):
    inside_out = BALL[:-2] + '><boolean name="flip_normals" value="true"/></shape>'
    found, expected = (mitsuba_geometry(write(camera(), ball), PIXELS) for ball in (inside_out, BALL))
    np.testing.assert_allclose(found.normals, expected.normals, atol=1e-6)
    sky = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    visible = mitsuba_geometry(write(camera(), inside_out), PIXELS, towards=sky).visible
    np.testing.assert_array_equal(visible, found.normals @ sky.T > 0)


def test_the_cache_needs_no_mitsuba_and_knows_the_content(mitsuba, write, monkeypatch):
    path = write(camera(scale=1.5), BALL, LAMP, "</shape>")
    scene = Scene(resolution=12, light_rows=4, geometry=path.name)
    first = load_geometry(scene, base=path.parent)
    others = [{"resolution": 13}, {"light_rows": 5}, {"shape": "ball"}, {"shadows": False}]
    found = {load_geometry(dataclasses.replace(scene, **o), base=path.parent).sha256 for o in others}
    assert len(found | {first.sha256}) == 5
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    second = load_geometry(scene, base=path.parent)
    assert second.sha256 == first.sha256
    assert second.visible is not None
    np.testing.assert_array_equal(second.visible, first.visible)
    write(camera(scale=1.6), BALL, LAMP, "</shape>")
    with pytest.raises(
        FittersError, match=r"scene.xml: scene files need Mitsuba 3: pip install 'gpsearch\[mitsuba\]'"
    ):
        load_geometry(scene, base=path.parent)


def test_the_variant_and_the_level_of_messages_are_restored(mitsuba, write):
    mitsuba.set_variant("scalar_spectral")
    mitsuba.set_log_level(mitsuba.LogLevel.Info)
    try:
        mitsuba_geometry(write(camera(), BALL), 4)
        assert mitsuba.variant() == "scalar_spectral"
        assert mitsuba.log_level() == mitsuba.LogLevel.Info
    finally:
        mitsuba.set_log_level(mitsuba.LogLevel.Warn)
        mitsuba.set_variant("scalar_rgb")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ((camera(),), "scene.xml: no pixel shows a shape; move the camera"),
        ((camera(origin="0,0,-4"), LAMP, "</shape>"), None),
        ((BALL,), "scene.xml: has no <sensor>"),
        ((camera(), '<shape type="blob"/>'), "scene.xml: Mitsuba cannot load it .*blob.*; repair the scene file"),
        (
            (camera(), '<shape type="obj"><string name="filename" value="a.obj"/></shape>'),
            "cannot load it .*a.obj",
        ),
    ],
)
def test_a_scene_that_shows_nothing_or_is_broken_is_refused_in_a_line(mitsuba, write, content, message, capfd):
    path = write(*content)
    if message is None:
        assert len(mitsuba_geometry(path, 8).pixels)
        return
    with pytest.raises(FittersError, match=message) as error:
        mitsuba_geometry(path, 8)
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def test_a_file_that_is_not_there_or_no_scene_is_refused(mitsuba, write):
    with pytest.raises(FittersError, match=r"gone.xml: no such scene file"):
        load_geometry(Scene(geometry="gone.xml"))
    path = write()
    path.write_text('<shape version="3.0.0" type="sphere"/>')
    with pytest.raises(FittersError, match="holds Shape, not a scene"):
        mitsuba_geometry(path, 8)


@pytest.mark.parametrize("value", ["", 3])
def test_a_geometry_is_a_name_or_a_path(value):
    with pytest.raises(FittersError, match=r"geometry: .* is neither sphere nor the path of a scene file"):
        Scene(geometry=value)
