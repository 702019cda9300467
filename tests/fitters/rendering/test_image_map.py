"""The image map against closed forms and the light table."""

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.expressions import parse
from fitters.grid import CELLS, cell_directions
from fitters.materials import load_material
from fitters.models import FormulaModel
from fitters.rendering import image_map
from fitters.rendering.kernel import rows
from fitters.scenes import EnvironmentMap, Scene, light_table
from fitters.scenes.geometry import Geometry, sphere
from tests.fitters.models.sphere import directions


def radiance(light, geometry, values):
    """Radiance (p,) of the first channel for values (CELLS,), from the rows of the map alone."""
    pointers, cells, weights = rows(light, geometry.normals, geometry.views, geometry.visible)
    return np.add.reduceat(values[cells] * weights[:, 0], pointers[:-1])


def constant_light(light_rows):
    return EnvironmentMap(np.ones((light_rows, 2 * light_rows, 3)))


def test_a_white_surface_in_a_white_room_has_radiance_pi():
    seen = radiance(constant_light(48), sphere(12), np.ones(CELLS))
    np.testing.assert_allclose(seen, np.pi, rtol=2e-3)


@pytest.mark.parametrize(("alpha", "tolerance"), [(0.01, 0.08), (0.03, 0.04), (0.1, 0.03)])
def test_lobes_far_narrower_than_a_texel_keep_their_energy(alpha, tolerance):
    # In a white room a pixel shows what its view reflects, which quadrature over half vectors finds, too.
    def lobe(w_i, w_o):
        half = w_i + w_o
        cos_h = half[:, 2] / np.maximum(np.linalg.norm(half, axis=1), 1e-12)
        return np.where(w_i[:, 2] > 0, alpha**2 / (cos_h**2 * (alpha**2 - 1) + 1) ** 2, 0.0)

    geometry = sphere(24)
    seen = radiance(constant_light(48), geometry, lobe(*cell_directions()))
    # At grazing views the cells of the horizon decide, which are lit or not as a whole.
    facing = np.flatnonzero(geometry.normals[:, 2] > 0.4)
    for pixel in facing[::29]:
        w_o = np.array([np.sqrt(1 - geometry.normals[pixel, 2] ** 2), 0.0, geometry.normals[pixel, 2]])
        w_i, solid_angle = directions(w_o)
        expected = np.sum(lobe(w_i, w_o) * np.maximum(w_i[:, 2], 0) * solid_angle)
        assert seen[pixel] == pytest.approx(expected, rel=tolerance)


def test_the_mean_over_the_pixels_is_what_the_light_table_says():
    scene, material = Scene(light="studio", resolution=32, light_rows=32), load_material("builtin:rough-plastic")
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
    pointers, _, weights = rows(light, geometry.normals, geometry.views, None)
    irradiance = np.array([w.sum() for w in np.split(weights[:, 0], pointers[1:-1])])
    row, column = divmod(int(geometry.pixels[np.argmax(irradiance)]), 64)
    x, y = (column + 0.5) / 32 - 1, 1 - (row + 0.5) / 32
    at = towards[:2] if towards[2] > 0 else towards[:2] / np.linalg.norm(towards[:2])
    assert np.hypot(x - at[0], y - at[1]) < 0.06


def test_light_that_does_not_reach_a_pixel_does_not_count():
    light, geometry = constant_light(8), sphere(8)
    visible = np.ones((len(geometry.pixels), 128), bool)
    visible[0] = False
    hidden = Geometry(geometry.normals, geometry.views, geometry.pixels, geometry.shape, visible)
    pointers, _, _ = rows(light, hidden.normals, hidden.views, hidden.visible)
    whole, _, _ = rows(light, geometry.normals, geometry.views, None)
    assert pointers[1] == 0
    np.testing.assert_array_equal(np.diff(pointers)[1:], np.diff(whole)[1:])


def test_the_map_comes_from_the_cache_unchanged(tmp_path, monkeypatch):
    monkeypatch.setenv("GPSEARCH_CACHE", str(tmp_path))
    scene = Scene(light="overcast", resolution=8, light_rows=8)
    first, again = image_map(scene), image_map(scene)
    assert list(tmp_path.glob("image-*.npz"))
    for name in ("cells", "pointers", "columns", "weights", "pixels"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))


def test_values_of_another_number_of_cells_are_refused():
    seen = image_map(Scene(light="overcast", resolution=8, light_rows=8))
    with pytest.raises(FittersError, match="takes"):
        seen.picture(np.ones((3, 3)))
