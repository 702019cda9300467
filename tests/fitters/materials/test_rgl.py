from pathlib import Path

import numpy as np
import pytest

from fitters import grid
from fitters.errors import FittersError
from fitters.materials import load_material
from fitters.materials.rgl import RglMaterial

NAMES = [
    "acrylic_felt_green",
    "acrylic_felt_pink",
    "acrylic_felt_white",
    "aurora_white",
    "cardboard",
    "cc_ibiza_sunset",
    "cc_nothern_aurora",
    "cg_sunflower",
    "chm_light_blue",
    "cm_toxic_green",
    "colodur_azure_4e",
    "colodur_napoli_4f",
    "ilm_solo_m_68",
    "leaf_maple",
    "paper_white",
    "satin_purple",
    "vch_dragon_eye_red",
    "vch_ultra_pink",
]


def mitsuba_brdf(path: Path, w_i, w_o):
    """BRDF (n, 3) by Mitsuba's `measured` plugin, whose eval includes the cosine of w_o."""
    mi = pytest.importorskip("mitsuba", reason="Mitsuba 3 is the independent reader")
    mi.set_variant("scalar_rgb")
    plugin, context = mi.load_dict({"type": "measured", "filename": str(path)}), mi.BSDFContext()
    out = []
    for a, b in zip(w_i, w_o, strict=True):
        hit = mi.SurfaceInteraction3f()
        hit.wi = a
        out.append(plugin.eval(context, hit, b))
    return np.array(out) / w_o[:, 2:]


@pytest.mark.parametrize("name", NAMES)
def test_agrees_with_mitsuba_on_real_measurements(shared, random_pairs, name):
    path = shared / f"data/rgl/{name}_rgb.bsdf"
    ours, reference = RglMaterial.read(path).evaluate(*random_pairs), mitsuba_brdf(path, *random_pairs)
    relative = np.abs(ours - reference) / np.abs(reference)
    assert np.median(relative) < 1e-5
    assert np.quantile(relative, 0.99) < 0.02


@pytest.mark.parametrize("name", ["paper_white", "cardboard", "satin_purple"])
def test_real_measurements_are_nearly_reciprocal_so_the_cosine_is_divided_out(shared, random_pairs, name):
    measurement = RglMaterial.read(shared / f"data/rgl/{name}_rgb.bsdf")
    w_i, w_o = random_pairs
    forward, backward = measurement.evaluate(w_i, w_o), measurement.evaluate(w_o, w_i)
    assert np.median(np.abs(forward / backward - 1)) < 0.05


def test_agrees_with_mitsuba_whether_or_not_the_density_is_divided_out(simple_fields, write_bsdf, random_pairs):
    for flag in (0, 1):
        simple_fields["jacobian"] = np.full(1, flag, np.uint8)
        simple_fields["ndf"] = np.linspace(1, 3, 6, dtype=np.float32).reshape(2, 3)
        path = write_bsdf(simple_fields)
        ours, reference = RglMaterial.read(path).evaluate(*random_pairs), mitsuba_brdf(path, *random_pairs)
        np.testing.assert_allclose(ours, reference, rtol=1e-4)


def test_closed_form(simple_fields, write_bsdf, random_pairs):
    w_i, w_o = random_pairs
    half = w_i + w_o
    x = np.sqrt(np.arccos(half[:, 2] / np.linalg.norm(half, axis=1)) * 2 / np.pi)
    azimuth = np.arctan2(half[:, 1], half[:, 0]) - np.arctan2(w_i[:, 1], w_i[:, 0])
    y = (azimuth / (2 * np.pi) + 0.5) % 1
    # Integral of the density, 1 at the zenith and 2 x at the horizon, that is between them by angle.
    share = np.arccos(w_i[:, 2]) * 2 / np.pi
    sample_x = (1 - share) * x + share * x**2
    expected = np.stack([1 + sample_x, 1 + y, np.full(300, -0.5)], axis=-1) / w_o[:, 2:]
    measurement = RglMaterial.read(write_bsdf(simple_fields))
    np.testing.assert_allclose(measurement.evaluate(w_i, w_o), expected, rtol=1e-6)
    assert measurement.description == "a closed form"


def test_is_isotropic(simple_fields, write_bsdf, random_pairs):
    w_i, w_o = random_pairs
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    measurement = RglMaterial.read(write_bsdf(simple_fields))
    np.testing.assert_allclose(
        measurement.evaluate(w_i, w_o), measurement.evaluate(w_i @ turn, w_o @ turn), rtol=1e-9
    )


def test_reflects_nothing_below_the_horizon_and_keeps_the_shape(simple_fields, write_bsdf):
    measurement = RglMaterial.read(write_bsdf(simple_fields))
    up, down = np.array([0.0, 0.6, 0.8]), np.array([0.0, 0.6, -0.8])
    assert measurement.evaluate(up, down).tolist() == [0, 0, 0]
    assert measurement.evaluate(down, up).tolist() == [0, 0, 0]
    assert measurement.evaluate(np.broadcast_to(up, (2, 5, 3)), up).shape == (2, 5, 3)


def test_the_table_averages_both_orders_of_the_directions(simple_fields, write_bsdf):
    measurement = RglMaterial.read(write_bsdf(simple_fields))
    table = measurement.resample().reshape(3, -1).T
    some = np.random.default_rng(0).choice(np.flatnonzero(grid.above_horizon()), 2000, replace=False)
    w_i, w_o = (w[some] for w in grid.cell_directions())
    forward, backward = measurement.evaluate(w_i, w_o), measurement.evaluate(w_o, w_i)
    tolerance = 1e-5 * np.maximum(np.abs(forward), np.abs(backward))
    assert np.all(table[some] >= np.minimum(forward, backward) - tolerance)
    assert np.all(table[some] <= np.maximum(forward, backward) + tolerance)
    assert np.isnan(table[~grid.above_horizon().ravel()]).all()


def test_a_real_measurement_becomes_a_material_and_is_cached(shared, monkeypatch):
    path = shared / "data/rgl/cg_sunflower_rgb.bsdf"
    material = load_material(path)
    assert (material.name, material.source) == ("cg_sunflower_rgb", "RGL")
    assert np.array_equal(material.valid, grid.above_horizon())
    # Yellow beyond the RGB gamut: blue is negative in most cells, red and green hardly anywhere.
    assert material.negative[2] > 0.5
    assert max(material.negative[:2]) < 0.01

    monkeypatch.setattr(RglMaterial, "resample", lambda self: pytest.fail("resampled again"))
    again = load_material(path)
    assert np.array_equal(again.table, material.table)
    assert again.sha256 == material.sha256


def test_an_out_of_gamut_channel_is_set_to_zero_and_counted(simple_fields, write_bsdf):
    material = load_material(write_bsdf(simple_fields))
    assert material.negative == (0.0, 0.0, 1.0)
    assert not material.table[2].any()
    assert material.table[:2, material.valid].min() > 0


def test_samples_that_are_not_finite_invalidate_their_cells_only(simple_fields, write_bsdf):
    simple_fields["rgb"][0, :, 0, 0, 0] = np.nan
    material = load_material(write_bsdf(simple_fields))
    assert 0 < material.valid.sum() < grid.above_horizon().sum()


def without(fields, name):
    return {key: array for key, array in fields.items() if key != name}


def changed(fields, **arrays):
    return fields | arrays


BROKEN = {
    "spectral": (lambda f: without(f, "rgb") | {"spectra": f["rgb"]}, "spectral.*_rgb"),
    "lacks a field": (lambda f: without(f, "sigma"), "lacks the field sigma"),
    "lacks fields": (lambda f: without(without(f, "ndf"), "vndf"), "lacks the fields ndf, vndf"),
    "anisotropic": (
        lambda f: changed(f, phi_i=np.linspace(0, 3, 8, dtype=np.float32)),
        "anisotropic.*8 incident",
    ),
    "integers": (lambda f: changed(f, ndf=np.ones((2, 3), np.int32)), "'ndf' holds int32 numbers"),
    "rank": (lambda f: changed(f, vndf=f["vndf"][0]), "'vndf' has the shape 2 x 6 x 9"),
    "slices": (lambda f: changed(f, rgb=f["rgb"][:, :1]), "'rgb' has the shape 1 x 1 x 3 x 5 x 5"),
    "one channel": (lambda f: changed(f, rgb=f["rgb"][:, :, :1]), "1 x 2 x 3 x rows x columns is needed"),
    "one node": (lambda f: changed(f, sigma=f["sigma"][:, :1]), "'sigma' has the shape 2 x 1"),
    "empty": (lambda f: changed(f, ndf=f["ndf"][:0]), "'ndf' has the shape 0 x 3"),
    "no angles": (lambda f: changed(f, theta_i=f["theta_i"][:1]), "'theta_i' has the shape 1"),
    "unordered": (lambda f: changed(f, theta_i=f["theta_i"][::-1]), "'theta_i' is not increasing"),
    "degrees": (lambda f: changed(f, theta_i=np.float32([0, 90])), "within 0 to pi/2"),
    "NaN": (lambda f: changed(f, vndf=f["vndf"] * np.float32("nan")), "'vndf' holds NaN"),
    "negative density": (lambda f: changed(f, vndf=-f["vndf"]), "'vndf' holds negative"),
    "empty slice": (lambda f: changed(f, vndf=0 * f["vndf"]), "an empty slice"),
    "no area": (lambda f: changed(f, sigma=0 * f["sigma"]), "'sigma' holds projected areas"),
    "NaN-filled": (lambda f: changed(f, rgb=f["rgb"] * np.float32("nan")), "none of its 1,458,000 cells"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_file_of_another_kind_is_refused_by_name(simple_fields, write_bsdf, case):
    breaks, message = BROKEN[case]
    with pytest.raises(FittersError, match=f"^sample_rgb.*{message}"):
        load_material(write_bsdf(breaks(simple_fields)))
