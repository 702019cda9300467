"""The light table against closed forms and against the grid's own half/difference angles."""

import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pytest
from fitters.scenes.kernel import integrate, sphere_normals

from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, cell_index, half_diff
from fitters.scenes import EnvironmentMap, LightTable, Scene, light_table, load_light

GRACE = Path(__file__).parents[4] / "shared/data/envmaps/grace_probe_latlong.hdr"
SMALL = Scene(resolution=8, light_rows=6)


@pytest.fixture(autouse=True)
def cache_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("GPSEARCH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def single_texel(rows, row, column, colour=(1.0, 2.0, 4.0)):
    radiance = np.zeros((rows, 2 * rows, 3))
    radiance[row, column] = colour
    return EnvironmentMap(radiance)


def local_pairs(normals, directions):
    """w_i and w_o (pixels, texels, 3) in a frame whose z is the pixel's normal."""
    tangents = np.cross(normals, [0.3, -0.5, 0.8])
    tangents /= np.linalg.norm(tangents, axis=-1, keepdims=True)
    frames = np.stack([tangents, np.cross(normals, tangents), normals], axis=1)
    w_i = np.einsum("pij,tj->pti", frames, directions)
    return w_i, np.broadcast_to(frames[:, None, :, 2], w_i.shape)


def table_through_the_grid(light, normals):
    """The light table by another road: rotate each pair into the pixel's frame, then ask `fitters.grid`."""
    w_i, w_o = local_pairs(normals, light.directions().reshape(-1, 3))
    above = w_i[..., 2] > 0
    cells = cell_index(*half_diff(w_i[above], w_o[above]))
    emission = (light.radiance * light.solid_angles()[..., None]).reshape(-1, 3)
    carried = (w_i[..., 2:] * emission)[above]
    sums = [np.bincount(cells, weights=carried[:, c], minlength=CELLS) for c in range(3)]
    return np.stack(sums).reshape(3, *SHAPE) / len(normals)


def irradiance(light, normals):
    """Light that reaches each pixel (pixels, 3), without any cells."""
    cosines = np.clip(normals @ light.directions().reshape(-1, 3).T, 0, None)
    return cosines @ (light.radiance * light.solid_angles()[..., None]).reshape(-1, 3)


def test_pixels_are_the_disc_inside_the_image():
    normals = sphere_normals(64)
    assert len(normals) == pytest.approx(0.998 * np.pi / 4 * 64**2, rel=0.005)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-14)
    assert normals[:, 2].min() > np.sqrt(1 - 0.998)
    np.testing.assert_array_equal(sphere_normals(1), [[0, 0, 1]])


def test_constant_light_gives_pi_per_pixel():
    constant = EnvironmentMap(np.broadcast_to([1.0, 2.0, 3.0], (48, 96, 3)).copy())
    for normal in sphere_normals(5):
        total = integrate(constant, normal[None]).sum(axis=(1, 2, 3))
        np.testing.assert_allclose(total, np.pi * np.array([1, 2, 3]), rtol=4e-3)


def test_constant_light_converges_to_pi():
    normals = sphere_normals(16)
    errors = []
    for rows in (6, 24, 96):
        total = integrate(EnvironmentMap(np.ones((rows, 2 * rows, 3))), normals)[0].sum()
        errors.append(abs(total / np.pi - 1))
    assert errors[0] > 4 * errors[1] > 16 * errors[2]
    assert errors[2] < 2e-4


@pytest.mark.parametrize("row", range(1, 11, 3))
@pytest.mark.parametrize("column", [3, 8, 13, 20])
def test_a_single_texel_lights_exactly_the_cells_that_geometry_says(row, column):
    light, normals = single_texel(12, row, column), sphere_normals(24)
    table = integrate(light, normals)
    expected = table_through_the_grid(light, normals)
    np.testing.assert_array_equal(table > 0, expected > 0)
    np.testing.assert_allclose(table, expected, rtol=1e-12)

    # By hand: theta_diff is half the angle to the viewer at every pixel, and the power is L cos d omega.
    direction = light.directions()[row, column]
    bins = np.unique(np.nonzero(table[0])[1])
    assert bins.tolist() == [int(np.degrees(np.arccos(direction[2])) / 2)]
    cosines = np.clip(normals @ direction, 0, None)
    expected_sum = np.array([1.0, 2.0, 4.0]) * light.solid_angles()[row] * cosines.mean()
    np.testing.assert_allclose(table.sum(axis=(1, 2, 3)), expected_sum, rtol=1e-12)


def test_a_mirror_pixel_lies_at_theta_half_zero():
    light = single_texel(12, 4, 9)
    half = light.directions()[4, 9] + [0, 0, 1]
    normal = half / np.linalg.norm(half)
    table = integrate(light, normal[None])
    assert np.nonzero(table[0])[0].tolist() == [0]


def test_the_whole_table_agrees_with_the_grid():
    light = EnvironmentMap(np.random.default_rng(1).exponential(size=(16, 32, 3))).rotated(1.7)
    normals = sphere_normals(20)
    table, expected = integrate(light, normals), table_through_the_grid(light, normals)
    np.testing.assert_array_equal(table > 0, expected > 0)
    np.testing.assert_allclose(table, expected, rtol=1e-12)
    np.testing.assert_allclose(table.sum(axis=(1, 2, 3)), irradiance(light, normals).mean(axis=0), rtol=1e-12)


def test_a_light_table_holds_the_recipe_it_was_asked_for():
    scene = Scene("overcast", rotation=30.0, resolution=12, light_rows=8)
    result = light_table(scene)
    expected = integrate(load_light("overcast").resampled(8, 30.0), sphere_normals(12))
    np.testing.assert_array_equal(result.table, expected.astype(np.float32))
    np.testing.assert_array_equal(result.lit, (expected > 0).any(axis=0))


def test_full_turns_change_nothing_and_other_turns_do():
    base = light_table(SMALL)
    assert light_table(dataclasses.replace(SMALL, rotation=-720.0)).sha256 == base.sha256
    turned = light_table(dataclasses.replace(SMALL, rotation=90.0))
    assert turned.sha256 != base.sha256
    assert not np.array_equal(turned.table, base.table)


def test_every_number_and_the_light_enter_the_hash():
    scenes = [
        SMALL,
        Scene("overcast", 0, 8, 6),
        Scene("studio", 5, 8, 6),
        Scene("studio", 0, 9, 6),
        Scene("studio", 0, 8, 7),
    ]
    assert len({light_table(scene).sha256 for scene in scenes}) == len(scenes)


def test_the_second_time_comes_from_the_cache(monkeypatch, cache_folder):
    first = light_table(SMALL)
    assert [file.name for file in cache_folder.iterdir()] == [f"light-{first.sha256}.npz"]
    monkeypatch.setattr("fitters.scenes.table.integrate", None)
    second = light_table(SMALL)
    np.testing.assert_array_equal(second.table, first.table)
    np.testing.assert_array_equal(second.lit, first.lit)


@pytest.mark.parametrize("damage", ["cut", "flip", "empty"])
def test_a_damaged_cache_file_is_built_again(cache_folder, damage):
    first = light_table(SMALL)
    (file,) = cache_folder.iterdir()
    whole = file.read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 255]) + whole[middle + 1 :]
    file.write_bytes({"cut": whole[:middle], "flip": flipped, "empty": b""}[damage])
    np.testing.assert_array_equal(light_table(SMALL).table, first.table)
    assert file.read_bytes() == whole


def test_a_table_cannot_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        light_table(SMALL).table[0, 0, 0, 0] = 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"table": np.zeros((3, 9), np.float32)}, "float32 \\(3, 9\\)"),
        ({"table": np.full((3, *SHAPE), np.nan, np.float32)}, "not finite"),
        ({"table": np.zeros((3, *SHAPE), np.float32), "lit": np.zeros(SHAPE, bool)}, "no light reaches"),
        ({"lit": np.ones(SHAPE, bool)}, "`lit` is not where"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(change, message):
    with pytest.raises(FittersError, match=message):
        dataclasses.replace(light_table(SMALL), **change)


def test_a_light_behind_the_sphere_is_an_error_with_advice():
    table = integrate(single_texel(64, 32, 0), sphere_normals(8)).astype(np.float32)
    with pytest.raises(FittersError, match="rotate the light"):
        LightTable(table, table.any(axis=0), "")


def test_a_scene_travels_and_can_be_a_key():
    assert pickle.loads(pickle.dumps(SMALL)) == SMALL
    assert {SMALL: 1}[Scene(resolution=8, light_rows=6)] == 1


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"light": ""}, "light: ''"),
        ({"rotation": float("nan")}, "rotation: nan"),
        ({"resolution": 0}, "resolution: 0 is not a whole number from 1 to 1024"),
        ({"resolution": 6.5}, "resolution: 6.5"),
        ({"resolution": True}, "resolution: True"),
        ({"light_rows": 4096}, "light_rows: 4096 is not a whole number from 2 to 1024"),
    ],
)
def test_bad_numbers_are_named(numbers, message):
    with pytest.raises(FittersError, match=message):
        Scene(**numbers)


@pytest.mark.skipif(not GRACE.exists(), reason=f"the light probe {GRACE} is not here")
def test_grace_cathedral():
    scene = Scene(GRACE.name)
    result = light_table(scene, base=GRACE.parent)
    light = load_light(str(GRACE))
    assert light.radiance.shape == (512, 1024, 3)
    reduced = light.reduced(48)
    np.testing.assert_allclose(reduced.power(), light.power(), rtol=1e-9)
    total = result.table.sum(axis=(1, 2, 3), dtype=np.float64)
    np.testing.assert_allclose(total, irradiance(reduced, sphere_normals(64)).mean(axis=0), rtol=1e-6)
    assert 500_000 < result.lit.sum() < 700_000
