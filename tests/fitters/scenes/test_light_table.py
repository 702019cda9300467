"""The light table against closed forms, against samples and against the grid's own half/difference angles."""

import dataclasses
import pickle

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, above_horizon, cell_index, half_diff
from fitters.scenes import EnvironmentMap, LightTable, Scene, light_table, load_light, sampled, sphere
from fitters.scenes.geometry import Geometry
from fitters.scenes.geometry import sphere as seen_sphere
from fitters.scenes.rings import ring_energies
from fitters.scenes.sampled import sampled_table
from fitters.scenes.sphere import sphere_light, sphere_table
from tests.shared_data import SHARED

GRACE = SHARED / "data/envmaps/grace_probe_latlong.hdr"
SMALL = Scene()


@pytest.fixture(autouse=True)
def cache_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("GPSEARCH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture(scope="module")
def noise():
    """A light of strong contrast, small enough to be added up texel by texel."""
    return EnvironmentMap(np.random.default_rng(1).exponential(size=(16, 32, 3)) ** 3)


def single_texel(rows, row, column, colour=(1.0, 2.0, 4.0)):
    radiance = np.zeros((rows, 2 * rows, 3))
    radiance[row, column] = colour
    return EnvironmentMap(radiance)


def distance(table, other):
    """Relative L2 distance, the largest of the channels."""
    return max(np.linalg.norm(a - b) / np.linalg.norm(b) for a, b in zip(table, other, strict=True))


def slabs(table):
    """Sums over slabs of ten by ten by twenty cells, which samples can resolve."""
    return table.reshape(3, 9, 10, 9, 10, 9, 20).sum(axis=(2, 4, 6))


def drawn_table(light, count, seed=0):
    """The light table by samples and the grid's own angles: points of the disc, directions by energy."""
    rng = np.random.default_rng(seed)
    radius, turn = np.sqrt(rng.random(count)), rng.uniform(0, 2 * np.pi, count)
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    normals = np.stack([x, y, np.sqrt(1 - radius**2)], axis=-1)
    shares = (light.radiance.sum(axis=-1) * light.solid_angles()).ravel()
    texel = rng.choice(len(shares), count, p=shares / shares.sum())
    row, column = np.divmod(texel, 2 * light.rows)
    edges = np.cos(np.arange(light.rows + 1) / light.rows * np.pi)
    height = edges[row] + rng.random(count) * (edges[row + 1] - edges[row])
    phi = (column + rng.random(count)) / light.rows * np.pi
    across = np.sqrt(1 - height**2)
    towards = np.stack([across * np.sin(phi), height, -across * np.cos(phi)], axis=-1)
    tangents = np.cross(normals, [0.3, -0.5, 0.8])
    tangents /= np.linalg.norm(tangents, axis=-1, keepdims=True)
    frames = np.stack([tangents, np.cross(normals, tangents), normals], axis=1)
    w_i, w_o = np.einsum("pij,pj->pi", frames, towards), frames[..., 2]
    above = w_i[:, 2] > 0
    cells = cell_index(*half_diff(w_i[above], w_o[above]))
    # Radiance over density, times the cosine.
    radiance = light.radiance[row, column] / light.radiance[row, column].sum(axis=-1, keepdims=True) * shares.sum()
    carried = (radiance * w_i[:, 2:])[above] / count
    return np.stack([np.bincount(cells, carried[:, c], CELLS) for c in range(3)]).reshape(3, *SHAPE)


def test_constant_light_gives_pi():
    constant = EnvironmentMap(np.broadcast_to([1.0, 2.0, 3.0], (48, 96, 3)).copy())
    total = sphere_light(constant).sum(axis=(1, 2, 3))
    np.testing.assert_allclose(total, np.pi * np.array([1, 2, 3]), rtol=1e-5)


@pytest.mark.parametrize(("row", "column"), [(6, 15), (3, 9), (8, 20), (5, 2), (11, 20)])
def test_all_cells_together_carry_what_a_white_sphere_shows_of_its_light(row, column):
    """Lambert's phase law: lit from an angle g, the sphere shows on average 2 / 3 pi (sin g + (pi - g) cos g)."""
    light = single_texel(12, row, column)
    fine = EnvironmentMap(np.repeat(np.repeat(light.radiance, 40, axis=0), 40, axis=1))
    g = np.arccos(fine.directions()[..., 2])
    seen = 2 / (3 * np.pi) * (np.sin(g) + (np.pi - g) * np.cos(g))
    expected = np.sum(fine.radiance * (fine.solid_angles() * seen)[..., None], axis=(0, 1))
    # A texel behind the sphere lights a crescent: rings of half a degree and four azimuths show there.
    np.testing.assert_allclose(sphere_light(light).sum(axis=(1, 2, 3)), expected, rtol=2e-3)


def test_it_agrees_with_samples_of_the_same_light(noise):
    table = slabs(sphere_light(noise))
    first, second = slabs(drawn_table(noise, 1_000_000)), slabs(drawn_table(noise, 1_000_000, seed=1))
    scatter = distance(first, second)
    assert scatter < 0.08
    assert distance((first + second) / 2, table) < scatter


def test_theta_diff_is_half_the_angle_to_the_viewer():
    light = single_texel(180, 60, 200)
    lit = np.unique(np.nonzero(sphere_light(light)[0])[1])
    angle = np.degrees(np.arccos(light.directions()[60, 200, 2])) / 2
    assert abs(lit - angle).max() < 1.5


def test_it_has_converged(noise, monkeypatch):
    """Twice as many rings and azimuths move it by a thousandth; half as many would have, too."""
    table = sphere_light(noise)
    monkeypatch.setattr(sphere, "RINGS", 2 * sphere.RINGS)
    monkeypatch.setattr(sphere, "AZIMUTHS", 2 * sphere.AZIMUTHS)
    assert distance(table, sphere_light(noise)) < 1e-3


def test_the_horizon_cuts_cells():
    """Cells whose middle lies below it carry the light of the part that does not, far less than a whole cell."""
    table = sphere_table(np.ones((360, 3)))[0]
    below = ~above_horizon()
    carried = (table[below] > 0).sum()
    assert 0 < carried < 0.05 * above_horizon().sum()
    assert table[below].sum() < 1e-4 * table.sum()
    # No cell that lies above as a whole is left out.
    assert np.all(table[above_horizon()] > 0)


@pytest.mark.parametrize("turn", [0.0, 90.0])
def test_a_light_table_is_that_of_the_named_light(turn):
    result = light_table(Scene("overcast", rotation=turn))
    expected = sphere_light(load_light("overcast").rotated(turn))
    np.testing.assert_allclose(result.table, expected, rtol=1e-5, atol=1e-12)
    np.testing.assert_array_equal(result.lit, (result.table > 0).any(axis=0))
    assert result.distance == 0.0
    assert result.converged


@pytest.mark.parametrize("tolerance", [0.6, pytest.param(0.3, marks=pytest.mark.long)])
def test_sampling_finds_the_closed_form(noise, tolerance):
    """As far from it as it says itself, and without a bias."""
    expected = sphere_light(noise)
    table, stated = sampled_table(noise, seen_sphere(256), seen_sphere(16), 8, tolerance=tolerance)
    assert stated < tolerance
    assert distance(table, expected) == pytest.approx(stated, rel=0.15)
    np.testing.assert_allclose(table.sum(axis=(1, 2, 3)), expected.sum(axis=(1, 2, 3)), rtol=0.01)
    assert distance(slabs(table), slabs(expected)) < 0.05


def test_sampling_that_may_not_go_on_says_how_far_it_got(noise, monkeypatch):
    monkeypatch.setattr(sampled, "ROUNDS", 1)
    _, first = sampled_table(noise, seen_sphere(64), seen_sphere(16), 8, tolerance=1e-3)
    monkeypatch.setattr(sampled, "ROUNDS", 3)
    _, third = sampled_table(noise, seen_sphere(64), seen_sphere(16), 8, tolerance=1e-3)
    assert 1e-3 < third < 0.9 * first


def test_points_see_what_the_nearest_pixel_sees(noise):
    image = seen_sphere(16)
    left = image.normals[:, 0] < 0
    half = Geometry(
        image.normals, image.views, image.pixels, image.shape, np.repeat(left[:, None], 2 * 8**2, axis=1)
    )
    points = seen_sphere(64)
    table, _ = sampled_table(noise, points, half, 8, tolerance=1.0)
    shown = points.normals[:, 0] < 0
    dark = Geometry(points.normals[shown], points.views[shown], points.pixels[shown], points.shape)
    expected, _ = sampled_table(noise, dark, seen_sphere(16), 8, tolerance=1.0)
    share = len(dark.pixels) / len(points.pixels)
    assert distance(slabs(table), slabs(expected) * share) < 0.1


def test_full_turns_change_nothing_and_other_turns_do():
    base = light_table(SMALL)
    assert light_table(dataclasses.replace(SMALL, rotation=-720.0)).sha256 == base.sha256
    turned = light_table(dataclasses.replace(SMALL, rotation=90.0))
    assert turned.sha256 != base.sha256
    assert not np.array_equal(turned.table, base.table)


def test_the_light_and_its_rotation_enter_the_hash():
    scenes = [SMALL, Scene("overcast"), Scene("studio", rotation=5.0)]
    assert len({light_table(scene).sha256 for scene in scenes}) == len(scenes)


def test_the_picture_of_a_sphere_does_not_change_its_light():
    finer = Scene(resolution=2 * SMALL.resolution, light_rows=2 * SMALL.light_rows)
    assert light_table(finer).sha256 == light_table(SMALL).sha256


def test_the_second_time_comes_from_the_cache(monkeypatch, cache_folder):
    first = light_table(SMALL)
    assert [file.name for file in cache_folder.iterdir()] == [f"light-{first.sha256}.npz"]
    monkeypatch.setattr("fitters.scenes.table.sphere_light", None)
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


def test_a_scene_without_light_is_an_error_with_advice():
    table = np.zeros((3, *SHAPE), np.float32)
    with pytest.raises(FittersError, match="rotate the light"):
        LightTable(table, table.any(axis=0), "")


def test_a_scene_travels_and_can_be_a_key():
    assert pickle.loads(pickle.dumps(SMALL)) == SMALL
    assert {SMALL: 1}[Scene()] == 1


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
    """Every cell above the horizon carries light, and twice as many rings change little."""
    result = light_table(Scene(GRACE.name), base=GRACE.parent)
    light = load_light(str(GRACE))
    assert np.all(result.lit[above_horizon()])
    finer = sphere_table(ring_energies(light, 720))
    assert distance(result.table, finer) < 3e-4
