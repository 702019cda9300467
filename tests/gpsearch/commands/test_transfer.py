"""`gpsearch transfer`: train beside test, in numbers that can be had otherwise."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fitters.expressions import parse
from fitters.judging.card import Judge
from fitters.materials import load_material
from fitters.materials.merl import write_merl
from fitters.models import MODELS, FormulaModel
from gpsearch.judging import scenes
from gpsearch.judging.scenes import scene_of
from gpsearch.run import Store, result_of
from tests.gpsearch.small import FEW, gpsearch, run_search, small, small_text

TRAIN, TEST = ["glossy-plastic", "rough-plastic"], ["fabric"]
CHANGES: dict[str, Any] = {
    "materials": [f"builtin:{name}" for name in TRAIN],
    "test_materials": [f"builtin:{name}" for name in TEST],
    "baselines": ["lambert", "cook-torrance", "bivariate"],
    "budget": {"generations": 1},
    "search": FEW,
    "fit": {"starts": 64, "restarts": 2, "rounds": 1},
}


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Pictures of few pixels."""
    monkeypatch.setattr(scenes, "IMAGE_RESOLUTION", 32)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folders with a run, `run`, and one without test materials, `plain`; the metal in a file, and once more."""
    folder = tmp_path_factory.mktemp("transfer")
    run_search(folder / "run", small(folder, **CHANGES)).close()
    run_search(folder / "plain", small(folder, **CHANGES | {"name": "plain", "test_materials": []})).close()
    metal, plastic = load_material("builtin:metal"), load_material("builtin:rough-plastic")
    write_merl(folder / "steel.binary", metal.table, metal.valid)
    write_merl(folder / "glossy-plastic.binary", plastic.table, plastic.valid)
    (folder / "more").mkdir()
    write_merl(folder / "more" / "steel.binary", plastic.table, plastic.valid)
    return folder


def transferred(folder: Path, *options: str) -> dict[str, Any]:
    result = gpsearch("transfer", *options, "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


@pytest.fixture(scope="module")
def report(folder):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scenes, "IMAGE_RESOLUTION", 32)
        return transferred(folder, "run")


def exported(folder: Path, run: str = "run") -> dict[str, Any]:
    store = Store.open(folder / run)
    found = result_of(store, small(folder, **CHANGES)).to_json()
    store.close()
    return found


def entries(found: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {entry.get("id") or entry["name"]: entry for entry in found["front"] + found["baselines"]}


def test_every_model_of_the_run_is_there_and_ggx_though_it_is_no_baseline(report, folder):
    assert [model["name"] for model in report["models"]] == [*entries(exported(folder)), "ggx"]
    assert (report["materials"], report["test_materials"]) == (TRAIN, TEST)
    assert not set(report["materials"]) & set(report["test_materials"])
    assert all(list(model["materials"]) == [*TRAIN, *TEST] for model in report["models"])


def test_errors_are_those_of_the_export(report, folder):
    known = entries(exported(folder))
    for model in report["models"][:-1]:
        entry = known[model["name"]]
        assert (model["error"], model["test_error"]) == (entry["error"], entry["test"]["error"])
        for name, errors in (entry["errors"] | entry["test"]["errors"]).items():
            error = np.sqrt(np.mean(np.square(errors)))
            assert model["materials"][name]["error"] == pytest.approx(error, rel=1e-12)


def test_pictures_are_judged_as_cards_judge_them(report, folder):
    """Of models that are made here from the export, or looked up."""
    configuration = small(folder, **CHANGES)
    scene, known = scene_of(configuration), entries(exported(folder))
    for name in ("rough-plastic", "fabric"):
        material = load_material(f"builtin:{name}")
        judge = Judge(scene.image(), scene.light(), material)
        for model in (m for m in report["models"] if m["name"] in known):
            entry = known[model["name"]]
            made = MODELS["bivariate"].kept(material).model
            if "expression" in entry:
                expression = parse(entry["expression"])
                values = entry["parameters"] if name in TRAIN else entry["test"]["parameters"]
                columns = [values[symbol][name] for symbol in expression.parameters]
                made = FormulaModel(expression, np.array(columns).T.reshape(3, len(columns)))
            metrics = judge.card(made)[0].metrics
            for metric in ("l2", "1-ssim", "psnr"):
                assert model["materials"][name][metric] == pytest.approx(metrics[metric], rel=1e-4)


def test_means_and_shares_are_those_of_the_single_figures(report):
    by_name = {model["name"]: model for model in report["models"]}
    for model in report["models"]:
        for part, names in (("train", TRAIN), ("test", TEST)):
            for metric in ("error", "l2", "1-ssim", "psnr"):
                mean = np.mean([model["materials"][name][metric] for name in names])
                assert model[part][metric] == pytest.approx(mean, rel=1e-12)
        for reference in ("cook-torrance", "ggx"):
            for metric in ("error", "l2", "1-ssim"):
                old = by_name[reference]["materials"]
                shares = [1 - model["materials"][name][metric] / old[name][metric] for name in TEST]
                assert model["test"]["below"][reference][metric] == pytest.approx(np.mean(shares), abs=1e-12)
    assert set(by_name["ggx"]["test"]["below"]["ggx"].values()) == {0.0}


def test_the_figures_of_a_member_hold_all_materials_and_their_averages(report, folder):
    by_name = {model["name"]: model for model in report["models"]}
    member = report["member"]
    # By default the one of least error on the materials of the search.
    assert member["id"] == exported(folder)["front"][-1]["id"]
    for metric, figure in member["figures"].items():
        for part, names in (("train", TRAIN), ("test", TEST)):
            rows = figure[part]["materials"]
            assert list(rows) == names
            for name, row in rows.items():
                for column, model in (("new", member["id"]), ("ggx", "ggx"), ("cook-torrance", "cook-torrance")):
                    assert row[column] == by_name[model]["materials"][name][metric]
                assert row["below"]["ggx"] == pytest.approx(1 - row["new"] / row["ggx"], abs=1e-12)
            average = figure[part]["average"]
            for column in ("new", "ggx", "cook-torrance"):
                assert average[column] == pytest.approx(np.mean([row[column] for row in rows.values()]))
            shares = [row["below"]["cook-torrance"] for row in rows.values()]
            assert average["below"]["cook-torrance"] == pytest.approx(np.mean(shares), abs=1e-12)


def test_the_text_says_the_same(report, folder):
    other = exported(folder)["front"][0]
    result = gpsearch("transfer", "run", "--member", other["id"], cwd=folder)
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    for model in report["models"]:
        (line,) = (line for line in lines if f"{model['name']} " in line and "nodes:" not in line)
        for value in (model["train"]["l2"], model["test"]["1-ssim"]):
            assert (f"{value:.4f}" if value < 99 else f"{value:.1f}") in line
    assert f"found {other['id']}, {other['nodes']} nodes: {other['expression']}" in lines
    at = [lines.index(title) for title in ("training set", "testing set")]
    assert [line.split()[0] for line in lines[at[0] + 1 : at[1]]] == [*TRAIN, "average"]
    assert [line.split()[0] for line in lines[at[1] + 1 :]] == [*TEST, "average"]


def test_other_materials_are_fitted_here_and_leave_the_run_alone(folder, report):
    before = (folder / "run" / "run.sqlite").read_bytes()
    found = transferred(folder, "run", "--material", "steel.binary", "--material", "fabric")
    assert found["test_materials"] == ["steel", "fabric"]
    assert (folder / "run" / "run.sqlite").read_bytes() == before
    for model, stored in zip(found["models"], report["models"], strict=True):
        assert model["materials"]["fabric"] == pytest.approx(stored["materials"]["fabric"])
        assert model["materials"]["steel"]["error"] > 0


def test_a_run_without_test_materials_takes_some(folder, report):
    """Where they are the same, so is what is said of them."""
    found = transferred(folder, "plain", "--material", "builtin:fabric")
    assert found["models"] == report["models"]
    store = Store.open(folder / "plain")
    assert store.transfers() == {}
    store.close()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("nowhere",), "nowhere: no run here"),
        (("plain",), "plain has no test materials: name some with --material, or as `test_materials:`"),
        (("run", "--member", "12345678"), "--member 12345678: no formula of the front has this id; there are "),
        (("run", "--material", "rough-plastic"), "--material rough-plastic: the run was searched on it"),
        (("run", "--material", "builtin:rough-plastic"), "the run was searched on it; name materials that it was"),
        (("run", "--material", "glossy-plastic.binary"), "is called as builtin:glossy-plastic is; name each once"),
        (
            ("run", "--material", "steel.binary", "--material", "more/steel.binary"),
            "more/steel.binary is called as",
        ),
        (("run", "--material", "steel.binary", "--material", "./steel.binary"), "is named twice"),
        (("run", "--material", "gold.binary"), "--material gold.binary: there is no such file"),
        (("run", "--material", "builtin:gold"), "gold"),
    ],
)
def test_what_is_asked_for_wrongly_is_one_message_and_exit_status_2(folder, options, words):
    result = gpsearch("transfer", *options, cwd=folder)
    assert (result.returncode, result.stdout) == (2, "")
    assert words in result.stderr
    assert "Traceback" not in result.stderr


def test_a_material_of_the_search_under_another_name_is_refused(tmp_path):
    metal = load_material("builtin:metal")
    for name in ("steel", "iron"):
        write_merl(tmp_path / f"{name}.binary", metal.table, metal.valid)
    (tmp_path / "a.yaml").write_text(small_text(materials=["steel.binary"], budget={"generations": 1}, search=FEW))
    assert gpsearch("launch", "a.yaml", "--run", "run", cwd=tmp_path).returncode == 0
    result = gpsearch("transfer", "run", "--material", "iron.binary", cwd=tmp_path)
    assert (result.returncode, result.stdout) == (2, "")
    assert "iron: the run was searched on it, it holds what steel does; name materials with" in result.stderr


@pytest.mark.long
def test_a_table_that_cannot_be_fitted_to_a_test_material_is_no_error(tmp_path):
    """It has no test error, nothing lies below it, and the reason is told."""
    metal = load_material("builtin:metal")
    dark = metal.valid.copy()
    dark[:, 0] = False  # nothing is known of its backscattering
    write_merl(tmp_path / "dark.binary", metal.table, dark)
    changes = {"test_materials": ["builtin:fabric", "dark.binary"], "baselines": ["power-iterations"]}
    (tmp_path / "a.yaml").write_text(small_text(**changes, search=FEW, budget={"generations": 1}))
    launched = gpsearch("launch", "a.yaml", "--run", "run", cwd=tmp_path)
    assert launched.returncode == 0, launched.stderr
    (table,) = (line for line in launched.stdout.splitlines() if "power-iterations" in line)
    entry = json.loads((tmp_path / "run" / "front.json").read_text())["baselines"][0]
    assert table.split()[:3] == ["-", f"{entry['error']:.4f}", "-"]
    reason = "dark: no cell with theta_diff below 1 degree is valid"
    assert any(warning.startswith(reason) for warning in entry["test"]["warnings"])
    assert entry["test"]["errors"]["dark"] == [None] * 3

    found = {model["name"]: model for model in transferred(tmp_path, "run")["models"]}
    model = found["power-iterations"]
    assert set(model["materials"]["dark"].values()) == {None}
    assert None not in model["materials"]["fabric"].values()
    assert model["test"] == {
        **dict.fromkeys(("error", "l2", "1-ssim", "psnr")),
        "below": {name: dict.fromkeys(("error", "l2", "1-ssim")) for name in ("cook-torrance", "ggx")},
    }
    assert any(warning.startswith(reason) for warning in model["warnings"])
    judged = gpsearch("judge", "run", "--material", "dark", cwd=tmp_path)
    assert judged.returncode == 0, judged.stderr
    (line,) = (line for line in judged.stdout.splitlines() if line.startswith("power-iterations"))
    assert "  not fitted: " in line
    assert reason in line
