"""`gpsearch judge`: a run, a model by name, a saved model; what is asked for wrongly."""

import json

import numpy as np
import OpenImageIO as oiio
import pytest

from gpsearch.judging import scenes
from gpsearch.run import Store
from tests.gpsearch.small import FEW, LAMP, gpsearch, run_search, small

COARSE = 32
"""Pixels of a picture's side, where its content does not matter."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("judged")
    changes = {"budget": {"generations": 1}, "baselines": ["lambert", "bivariate"]}
    run_search(folder / "run", small(folder, search=FEW, **changes)).close()
    return folder


def test_a_run(folder, monkeypatch):
    monkeypatch.setattr(scenes, "IMAGE_RESOLUTION", COARSE)
    done = gpsearch("judge", "run", "--json", "-o", "pictures", cwd=folder)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert {"lambert", "bivariate"} < {model["name"] for model in report["models"]}
    assert report["scene"]["light"] == LAMP
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


def test_a_saved_model(folder, monkeypatch):
    monkeypatch.setattr(scenes, "IMAGE_RESOLUTION", COARSE)
    saved = gpsearch("fit", "bivariate", "builtin:metal", "--save", "b.npz", cwd=folder)
    assert saved.returncode == 0, saved.stderr
    done = gpsearch("judge", "b.npz", "--material", "builtin:metal", "--json", cwd=folder)
    kept = json.loads(done.stdout)["models"][0]["cards"]["metal"]["metrics"]
    run = json.loads(gpsearch("judge", "bivariate", "--material", "builtin:metal", "--json", cwd=folder).stdout)
    assert kept == run["models"][0]["cards"]["metal"]["metrics"]


@pytest.fixture(scope="module")
def tested(tmp_path_factory):
    """A folder with a run of two materials that has a test material."""
    folder = tmp_path_factory.mktemp("tested")
    changes = {"materials": ["builtin:metal", "builtin:rough-plastic"], "test_materials": ["builtin:fabric"]}
    run_search(folder / "run", small(folder, budget={"generations": 1}, search=FEW, **changes)).close()
    return folder


def judged(folder, *options):
    done = gpsearch("judge", *options, "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def report(tested):
    """Of `tested`, judged in small pictures."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scenes, "IMAGE_RESOLUTION", COARSE)
        return judged(tested, "run", "-o", "pictures")


def test_a_run_is_judged_on_test_materials_apart_from_the_others(tested, report, monkeypatch):
    monkeypatch.setattr(scenes, "IMAGE_RESOLUTION", COARSE)
    assert (report["materials"], report["test_materials"]) == (["metal", "rough-plastic"], ["fabric"])
    for model in report["models"]:
        assert list(model["cards"]) == ["metal", "rough-plastic", "fabric"]
        assert set(model["worst_material"].values()) <= {"metal", "rough-plastic"}
        assert set(model["worst_test_material"].values()) == {"fabric"}
    text = gpsearch("judge", "run", cwd=tested).stdout
    first, second = text.split("\n\n")
    count = len(report["models"])
    assert first.startswith(f"{count} models, 2 materials, under lamp; means over the materials\n")
    assert second.startswith(f"{count} models, 1 test material that the search was not on, under lamp;")
    assert len(first.splitlines()) == len(second.splitlines()) == 2 + count
    for model in report["models"]:
        (line,) = (line for line in second.splitlines() if line.startswith(model["name"]))
        assert f"{model['cards']['fabric']['metrics']['l2']:.4g}" in line
    assert len(list((tested / "pictures").glob("*.png"))) == count


def test_only_the_materials_that_are_named_are_judged(tested, report, monkeypatch):
    monkeypatch.setattr(scenes, "IMAGE_RESOLUTION", COARSE)
    one = judged(tested, "run", "--material", "fabric")
    assert (one["materials"], one["test_materials"]) == ([], ["fabric"])
    whole = {model["name"]: model["cards"]["fabric"] for model in report["models"]}
    assert {model["name"]: model["cards"]["fabric"] for model in one["models"]} == whole
    one = judged(tested, "run", "--material", "builtin:metal")
    assert one["materials"] == ["metal"]
    assert "test_materials" not in one


def test_to_a_material_that_is_new_to_the_run_all_models_are_refitted(report, folder, monkeypatch):
    """As if it had been a test material; beside it, materials of the run are what they were."""
    monkeypatch.setattr(scenes, "IMAGE_RESOLUTION", COARSE)
    new = judged(folder, "run", "--material", "builtin:fabric", "--material", "metal")
    assert (new["materials"], new["test_materials"]) == (["metal"], ["fabric"])
    known, fresh = (
        next(model["cards"]["fabric"] for model in one["models"] if model["name"] == "lambert")
        for one in (report, new)
    )
    assert fresh == known
    assert all(list(model["cards"]) == ["metal", "fabric"] for model in new["models"])
    store = Store.open(folder / "run")
    assert store.transfers() == {}
    store.close()


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
