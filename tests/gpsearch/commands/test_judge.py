"""`gpsearch judge`: a run, a model by name, a saved model; what is asked for wrongly."""

import json

import numpy as np
import OpenImageIO as oiio
import pytest

from tests.gpsearch.small import gpsearch, run_search, small


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("judged")
    run_search(
        folder / "run", small(folder, budget={"generations": 1}, baselines=["lambert", "bivariate"])
    ).close()
    return folder


def test_a_run(folder):
    done = gpsearch("judge", "run", "--json", "-o", "pictures", cwd=folder)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert {"lambert", "bivariate"} < {model["name"] for model in report["models"]}
    assert report["scene"]["light"] == "studio"
    for model in report["models"]:
        metrics = model["cards"]["metal"]["metrics"]
        assert metrics.keys() == report["metrics"].keys()
        assert model["worst_material"]["flip"] == "metal"
    light = {m["name"]: m["cards"]["metal"]["metrics"]["light"] for m in report["models"]}
    assert light["bivariate"] < light["lambert"]
    assert len(list((folder / "pictures").glob("*.png"))) == len(report["models"])
    pixels = oiio.ImageBuf(str(folder / "pictures" / "bivariate.png")).get_pixels(oiio.FLOAT)
    assert np.ptp(pixels) > 0.5


def test_a_model_by_name_in_another_scene_ranks_with_its_own_light(folder):
    done = gpsearch("judge", "lambert", "--material", "builtin:metal", "--scene", "overcast", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "under overcast" in done.stdout
    assert "lambert" in done.stdout


def test_a_saved_model(folder):
    saved = gpsearch("fit", "bivariate", "builtin:metal", "--save", "b.npz", cwd=folder)
    assert saved.returncode == 0, saved.stderr
    done = gpsearch("judge", "b.npz", "--material", "builtin:metal", "--json", cwd=folder)
    kept = json.loads(done.stdout)["models"][0]["cards"]["metal"]["metrics"]
    run = json.loads(gpsearch("judge", "bivariate", "--material", "builtin:metal", "--json", cwd=folder).stdout)
    assert kept == run["models"][0]["cards"]["metal"]["metrics"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("run", "--material", "gold"), "the run has models of metal"),
        (("ggx",), "name the materials to judge it on with --material"),
        (("gxg", "--material", "builtin:metal"), "did you mean ggx"),
        (("run", "--scene", "nowhere.hdr"), "no such file"),
        (("run", "--scene", "nowhere.yaml"), "no such file"),
        (("lost.npz", "--material", "builtin:metal"), "does not exist"),
    ],
)
def test_what_is_asked_for_wrongly(folder, arguments, said):
    done = gpsearch("judge", *arguments, cwd=folder)
    assert done.returncode == 2
    assert said in done.stderr
