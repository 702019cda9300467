"""`gpsearch fit` for baselines: what it reports, what it keeps in a file, what it refuses."""

import json

import numpy as np
import pytest

from fitters.fitting import Problem, model_errors
from fitters.materials import load_anisotropic, load_material
from fitters.models import load
from tests.fitters.models.power_iterations.closed_forms import Surface, direction
from tests.gpsearch.small import gpsearch

CHANNELS = 3
METAL = "builtin:metal"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with an anisotropic measurement, `cloth.bin`."""
    folder = tmp_path_factory.mktemp("fit")
    theta, phi = np.radians(np.arange(6) * 15.0), np.radians(np.arange(48) * 7.5)
    w = direction(theta[:, None], phi).reshape(-1, 3)
    surface = Surface("beckmann", 0.6, 0.4, 0.5, fresnel=(0.7, 0.5, 0.3))
    samples = surface.brdf(np.repeat(w, 288, axis=0), np.tile(w, (288, 1)))
    (folder / "cloth.bin").write_bytes(samples.T.astype("<f8").tobytes())
    (folder / "torn.bin").write_bytes(b"0" * 1000)
    return folder


def reported(folder, *arguments):
    result = gpsearch("fit", *arguments, "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def refused(folder, *arguments):
    """The message of a command that must end with status 2, and leave no file behind."""
    before = set(folder.iterdir())
    result = gpsearch("fit", *arguments, cwd=folder)
    assert (result.returncode, result.stdout) == (2, "")
    assert "Traceback" not in result.stderr
    assert set(folder.iterdir()) == before
    return result.stderr


@pytest.fixture(scope="module")
def naive(folder):
    return reported(folder, "npf-naive", METAL, "--save", "naive.npz")


def test_a_factor_model_reports_its_objective_and_starts(naive):
    assert (naive["model"], naive["material"], naive["materials"]) == ("npf-naive", "metal", ["metal"])
    assert (naive["floats"], naive["solver"], naive["warnings"]) == (1086, "joint", [])
    assert naive["fit_seconds"] > 0
    assert naive["error"] == pytest.approx(np.sqrt(np.mean(np.square(naive["errors"]["metal"]))))
    assert naive["error"] == naive["metrics"]["light"] < 0.1
    assert len(naive["objective"]) == len(naive["iterations"]) == CHANNELS
    (start,) = naive["starts"]
    assert start["name"] == "slices"
    assert start["objective"] == naive["objective"]


def test_the_saved_arrays_have_the_paper_s_names(folder, naive):
    with np.load(folder / "naive.npz") as stored:
        shapes = {name: stored[name].shape for name in ("rho_d", "rho_s", "D", "F", "H")}
    assert shapes == {"rho_d": (3,), "rho_s": (3,), "D": (90, 3), "F": (90, 3), "H": (180, 3)}
    model = load(folder / "naive.npz").model
    assert (model.kind, model.floats) == ("npf-naive", naive["floats"])
    assert model.fit_seconds == pytest.approx(naive["fit_seconds"], abs=1e-3)


def test_g_from_d_keeps_the_g_that_it_follows_from(folder):
    found = reported(folder, "npf-g-from-d", METAL, "--save", "smith.npz")
    assert found["floats"] == 546
    with np.load(folder / "smith.npz") as stored:
        assert stored["G"].shape == (90, 3)


def test_bivariate(folder):
    found = reported(folder, "bivariate", METAL, "--metric", "compressive", "--save", "table.npz")
    assert (found["floats"], found["metric"]) == (24300, "compressive")
    assert found["error"] == found["metrics"]["compressive"]
    with np.load(folder / "table.npz") as stored:
        assert stored["B"].shape == (90, 90, 3)


def test_power_iterations_report_roughness_and_the_fresnel_term(folder):
    found = reported(folder, "power-iterations", METAL, "--save", "microfacets.npz")
    assert found["floats"] == 540
    assert 0 < found["alpha_ggx"] < found["alpha_beckmann"]
    assert np.shape(found["fresnel"]) == (90, CHANNELS)
    assert len(found["fresnel_at_normal"]) == CHANNELS
    assert any("Fresnel term exceeds 1" in warning for warning in found["warnings"])
    with np.load(folder / "microfacets.npz") as stored:
        assert {"P", "D", "G1", "F", "theta", "theta_k", "theta_d"} <= set(stored.files)
        np.testing.assert_allclose(stored["F"], found["fresnel"])


def test_several_materials_have_a_model_each(folder):
    found = reported(folder, "power-iterations", METAL, "builtin:fabric")
    alone = reported(folder, "power-iterations", METAL)
    assert found["materials"] == list(found["errors"]) == list(found["fits"]) == ["metal", "fabric"]
    assert "material" not in found
    assert found["errors"]["metal"] == alone["errors"]["metal"]
    assert found["fits"]["metal"]["alpha_ggx"] == alone["alpha_ggx"]
    assert all(warning.startswith(("metal: ", "fabric: ")) for warning in found["warnings"])


def test_the_text_names_errors_objectives_alphas_and_warnings(folder):
    result = gpsearch("fit", "power-iterations", METAL, cwd=folder)
    assert result.returncode == 0
    lines = result.stdout.splitlines()
    assert lines[0].startswith("power-iterations: light error 0.")
    assert lines[0].endswith(" s, 540 floats")
    assert [line.split()[0] for line in lines[1:]] == [
        "metal",
        "red",
        "green",
        "blue",
        "alpha_ggx",
        "alpha_beckmann",
    ]
    assert result.stderr.startswith("warning: ")
    bivariate = gpsearch("fit", "bivariate", METAL, cwd=folder).stdout
    assert bivariate.count("objective (eq. 7)") == CHANNELS


def test_an_anisotropic_measurement_is_judged_over_its_samples(folder):
    found = reported(folder, "power-iterations-anisotropic", "cloth.bin", "--save", "cloth.npz")
    assert (found["metric"], found["material"]) == ("cosine", "cloth")
    assert "scene" not in found
    # Steps of 15 degrees leave the Fresnel term coarse.
    assert found["error"] < 0.15
    np.testing.assert_allclose(
        found["alpha_beckmann"][:2], Surface("beckmann", 0.6, 0.4, 0.5).alphas[:2], rtol=0.05
    )
    model = load(folder / "cloth.npz").model
    errors = model_errors(Problem([load_anisotropic("cloth.bin", base=folder)]), 0, model)["cosine"]
    assert found["errors"]["cloth"] == pytest.approx(errors)
    with np.load(folder / "cloth.npz") as stored:
        assert {"P", "D", "G1", "F", "phi", "theta", "theta_k", "theta_d"} <= set(stored.files)


def test_an_anisotropic_model_takes_an_isotropic_material_too(folder):
    found = reported(folder, "power-iterations-anisotropic", METAL)
    assert (found["metric"], found["scene"]) == ("light", "studio")
    assert len(found["alpha_ggx"]) == 3


def test_a_formula_is_saved_with_its_parameters(folder):
    found = reported(folder, "lambert", METAL, "--save", "lambert.npz")
    assert found["material"] == "metal"
    model = load(folder / "lambert.npz").model
    up = np.array([[0.0, 0.0, 1.0]])
    np.testing.assert_allclose(np.pi * model.evaluate(up, up)[0], found["parameters"]["p0"]["metal"])


def test_a_file_that_is_there_is_replaced(folder, naive):
    (folder / "again.npz").write_text("something else")
    assert gpsearch("fit", "bivariate", METAL, "--save", "again.npz", cwd=folder).returncode == 0
    assert load(folder / "again.npz").model.kind == "bivariate"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("npf-naiv", METAL), "did you mean npf-naive?"),
        (("power-iteration", METAL), "did you mean power-iterations?"),
        (("bivariat", METAL), "did you mean bivariate?"),
        (("cook-torance", METAL), "did you mean cook-torrance?"),
        (("zzz", METAL), "npf-independent-g"),
        (("bivariate", "missing.binary"), "missing.binary does not exist"),
        (("bivariate", METAL, METAL), "name each once"),
        (("bivariate", METAL, "--light", "missing.hdr"), "missing.hdr"),
        (("bivariate", METAL, "--solver", "awls"), "--solver: bivariate has none to choose"),
        (("ggx", METAL, "--solver", "joint"), "npf-naive have"),
        (("bivariate", "cloth.bin"), "only power-iterations-anisotropic takes .bin files"),
        (("ggx", "cloth.bin"), "only power-iterations-anisotropic takes .bin files"),
        (("power-iterations-anisotropic", "torn.bin"), "cut short"),
        (("power-iterations-anisotropic", "cloht.bin"), "Did you mean cloth.bin?"),
        (("power-iterations-anisotropic", "cloth.bin", METAL), "two commands"),
        (("power-iterations-anisotropic", "cloth.bin", "cloth.bin"), "name each once"),
        (("power-iterations-anisotropic", "cloth.bin", "--light", "studio"), "without a light"),
        (("bivariate", METAL, "builtin:fabric", "--save", "x.npz"), "fit each in its own command"),
        (("bivariate", METAL, "--save", "x.npy"), "ends in .npz, such as x.npz"),
        (("bivariate", METAL, "--save", "missing/x.npz"), "there is no folder missing"),
        (("p0 / (wi.z - wi.z)", METAL, "--json"), "is not finite on every cell"),
    ],
)
def test_what_cannot_be_fitted_or_kept_is_refused(folder, arguments, words):
    assert words in " ".join(refused(folder, *arguments).split())


def test_an_anisotropic_file_elsewhere_says_what_takes_it(folder):
    with pytest.raises(ValueError, match="only `gpsearch fit power-iterations-anisotropic` takes it"):
        load_material(folder / "cloth.bin")
