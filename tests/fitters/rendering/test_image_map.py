"""The image map against closed forms and the light table."""

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.expressions import parse
from fitters.grid import CELLS, cell_directions, cell_index, half_diff
from fitters.materials import load_material
from fitters.models import FormulaModel
from fitters.rendering import ImageMap, image_map
from fitters.rendering.maps import mapped
from fitters.rendering.shared_exponent import packed_row, unpacked
from fitters.scenes import EnvironmentMap, Scene, light_table
from fitters.scenes.geometry import Geometry, sphere
from fitters.testing.sphere import directions


def image_of(light, geometry, **numbers):
    """The image map of a light and a geometry; numbers say how fine it is."""
    light_rows = 1 if geometry.visible is None else int(np.sqrt(geometry.visible.shape[1] / 2))
    arrays = mapped(light, geometry, light_rows, **numbers)
    facing = np.sum(geometry.normals * geometry.views, axis=1)
    return ImageMap(**arrays, pixels=geometry.pixels, facing=facing, shape=geometry.shape, sha256="")


def radiance(light, geometry, values, **numbers):
    """Radiance (p,) of the first channel for values (CELLS,)."""
    seen = image_of(light, geometry, **numbers)
    return seen.radiance(np.tile(values[seen.cells, None], 3))[:, 0]


def some_pixels(resolution, count):
    """The sphere with `count` of its pixels only, spread over it."""
    whole = sphere(resolution)
    chosen = np.linspace(0, len(whole.pixels) - 1, count).astype(int)
    return Geometry(whole.normals[chosen], whole.views[chosen], whole.pixels[chosen], whole.shape)


def constant_light(light_rows):
    return EnvironmentMap(np.ones((light_rows, 2 * light_rows, 3)))


def test_a_white_surface_in_a_white_room_has_radiance_pi():
    seen = radiance(constant_light(48), sphere(12), np.ones(CELLS))
    np.testing.assert_allclose(seen, np.pi, rtol=1e-3)


@pytest.mark.parametrize(("alpha", "tolerance"), [(0.005, 0.02), (0.01, 0.01), (0.03, 0.01), (0.1, 0.01)])
def test_lobes_far_narrower_than_a_texel_keep_their_energy(alpha, tolerance):
    # In a white room a pixel shows what its view reflects, which quadrature over half vectors finds, too.
    def lobe(w_i, w_o):
        half = w_i + w_o
        cos_h = half[:, 2] / np.maximum(np.linalg.norm(half, axis=1), 1e-12)
        return np.where(w_i[:, 2] > 0, alpha**2 / (cos_h**2 * (alpha**2 - 1) + 1) ** 2, 0.0)

    geometry = some_pixels(24, 40)
    seen = radiance(constant_light(48), geometry, lobe(*cell_directions()))
    # At grazing views the cells of the horizon decide, which are lit or not as a whole.
    for pixel in np.flatnonzero(geometry.normals[:, 2] > 0.4):
        w_o = np.array([np.sqrt(1 - geometry.normals[pixel, 2] ** 2), 0.0, geometry.normals[pixel, 2]])
        w_i, solid_angle = directions(w_o)
        # As in a measurement, the lobe is what it is in the middle of its cell.
        middles = [w[cell_index(*half_diff(w_i, np.broadcast_to(w_o, w_i.shape)))] for w in cell_directions()]
        expected = np.sum(lobe(*middles) * np.maximum(w_i[:, 2], 0) * solid_angle)
        assert seen[pixel] == pytest.approx(expected, rel=tolerance)


def test_a_small_bright_window_is_not_missed():
    """One texel of half a degree, on a diffuse surface: its irradiance, at every pixel that it reaches."""
    texels = np.zeros((360, 720, 3))
    texels[120, 500] = 1.0
    light, geometry = EnvironmentMap(texels), some_pixels(32, 60)
    cosines = np.maximum(geometry.normals @ light.directions()[120, 500], 0.0)
    expected = cosines * light.solid_angles()[120, 0]
    seen = radiance(light, geometry, np.ones(CELLS))
    np.testing.assert_allclose(seen, expected, atol=0.01 * expected.max())


@pytest.mark.parametrize("name", ["metal", "glossy-plastic", "fabric"])
def test_pictures_have_converged(name):
    """Under a light of strong contrast, against one that is twice as fine in everything."""
    light = EnvironmentMap(np.random.default_rng(0).exponential(size=(64, 128, 3)) ** 4)
    geometry, material = some_pixels(64, 150), load_material(f"builtin:{name}")
    finer = {"steps": 6, "azimuths": 192, "spread": 1.0}
    used, limit = (image_of(light, geometry, **n).of_material(material).pixels for n in ({}, finer))
    assert np.linalg.norm(used - limit) < 0.02 * np.linalg.norm(limit)


def test_packed_colours_are_kept_to_nine_bits_of_their_largest_channel():
    colours = (1 + np.random.default_rng(0).exponential(size=(500, 3))) * np.logspace(-9, 0, 500)[:, None]
    colours[7] = 0.0
    words = np.empty(500, np.uint32)
    scale = packed_row(colours, np.arange(500, dtype=np.int32), words)
    np.testing.assert_array_less(
        np.abs(unpacked(words, scale) - colours).max(axis=1), colours.max(axis=1) / 500 + 1e-300
    )


def test_a_row_is_what_the_product_adds_up():
    seen = image_of(EnvironmentMap(np.random.default_rng(1).exponential(size=(8, 16, 3))), some_pixels(16, 9))
    values = np.random.default_rng(2).random((CELLS, 3))
    radiance = seen.radiance(values[seen.cells])
    for pixel in range(9):
        cells, weights = seen.row(pixel)
        assert np.all(np.diff(cells) > 0)
        np.testing.assert_allclose(np.sum(weights * values[cells], axis=0), radiance[pixel], rtol=1e-5)


def test_the_mean_over_the_pixels_is_what_the_light_table_says():
    scene, material = Scene(light="studio", resolution=64), load_material("builtin:rough-plastic")
    picture = image_map(scene).of_material(material)
    expected = np.sum(light_table(scene).table * material.table, axis=(1, 2, 3), dtype=np.float64)
    np.testing.assert_allclose(picture.pixels[picture.foreground].mean(axis=0), expected, rtol=5e-3)


def test_a_model_is_seen_where_its_material_was_measured():
    material = load_material("builtin:fabric")
    seen = image_map(Scene(light="studio", resolution=16, light_rows=16))
    white = FormulaModel(parse("1"), np.empty((3, 0)))
    ones = np.ones((len(seen.cells), 3))
    all_of_it, measured = seen.picture(ones), seen.of_model(white, material)
    assert 0 < seen.unmeasured(material) < 1e-3
    lost = 1 - measured.pixels.sum() / all_of_it.pixels.sum()
    assert lost == pytest.approx(seen.unmeasured(material), rel=1e-3)


def test_the_image_is_upright_and_not_mirrored():
    # Light from the upper right in front: the brightest pixel of a matte sphere is where the normal points to it.
    texels = np.zeros((16, 32, 3))
    texels[4, 20] = 1.0
    light = EnvironmentMap(texels)
    towards = light.directions()[4, 20]
    geometry = sphere(64)
    irradiance = radiance(light, geometry, np.ones(CELLS))
    row, column = divmod(int(geometry.pixels[np.argmax(irradiance)]), 64)
    x, y = (column + 0.5) / 32 - 1, 1 - (row + 0.5) / 32
    at = towards[:2] if towards[2] > 0 else towards[:2] / np.linalg.norm(towards[:2])
    assert np.hypot(x - at[0], y - at[1]) < 0.06


def test_light_that_does_not_reach_a_pixel_does_not_count():
    light, geometry = constant_light(8), sphere(8)
    visible = np.ones((len(geometry.pixels), 128), bool)
    visible[0] = False
    hidden = Geometry(geometry.normals, geometry.views, geometry.pixels, geometry.shape, visible)
    seen, whole = (radiance(light, one, np.ones(CELLS)) for one in (hidden, geometry))
    assert seen[0] == 0.0
    np.testing.assert_allclose(seen[1:], whole[1:], rtol=2e-3)


def test_the_map_comes_from_the_cache_unchanged(tmp_path, monkeypatch):
    monkeypatch.setenv("GPSEARCH_CACHE", str(tmp_path))
    scene = Scene(light="overcast", resolution=8, light_rows=8)
    first, again = image_map(scene), image_map(scene)
    assert list(tmp_path.glob("image-*.npz"))
    for name in ("cells", "pointers", "codes", "words", "scales", "pixels"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))


def test_values_of_another_number_of_cells_are_refused():
    seen = image_map(Scene(light="overcast", resolution=8, light_rows=8))
    with pytest.raises(FittersError, match="takes"):
        seen.picture(np.ones((3, 3)))
