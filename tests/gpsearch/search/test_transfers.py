"""The stage after a search: all that it lists, fitted to materials that it was not on."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from fitters.expressions import parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import RESIDUALS, model_errors, transfer
from fitters.fitting.problem import Problem
from fitters.materials import load_material
from fitters.models import MODELS, FormulaModel
from fitters.scenes import Scene, light_table
from gpsearch.configuration import Configuration
from gpsearch.exports import schema
from gpsearch.run import Store, result_of
from gpsearch.search.plan import plan, problem_recipe
from gpsearch.search.transfers import formula_jobs, transfer_lanes
from tests.gpsearch.small import LAMP, Watching, gpsearch, run_search, small, small_text, without_times, writing
from workers import DaskSettings, Done, Failure, LocalSettings, open_executor
from workers.local import LocalExecutor

TRAINING = ["metal", "glossy-plastic"]
TESTS = ["fabric", "rough-plastic"]
SCENE = Scene(LAMP, resolution=16, light_rows=8)


def builtin(names: list[str]) -> list[str]:
    return [f"builtin:{name}" for name in names]


def changes(tests: list[str] = TESTS) -> dict[str, Any]:
    return {
        "materials": builtin(TRAINING),
        "test_materials": builtin(tests),
        "budget": {"generations": 2},
        "baselines": ["lambert", "bivariate"],
        "culling": 0.02,
        "fit": {"starts": 64, "restarts": 2, "rounds": 1},
    }


def configured(folder: Path, tests: list[str] = TESTS) -> Configuration:
    return small(folder, **changes(tests))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a finished run, `run`."""
    folder = tmp_path_factory.mktemp("tested")
    run_search(folder / "run", configured(folder)).close()
    return folder


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the same run without test materials."""
    folder = tmp_path_factory.mktemp("without")
    run_search(folder / "run", configured(folder, [])).close()
    return folder


def exported(run: Path, tests: list[str] = TESTS) -> dict[str, Any]:
    store = Store.open(run)
    found = result_of(store, configured(run.parent, tests)).to_json()
    store.close()
    return json.loads(json.dumps(found))


def entries(found: dict[str, Any]) -> list[dict[str, Any]]:
    return found["front"] + found["baselines"]


def test_every_model_that_is_listed_is_tested_on_every_material(folder):
    found = exported(folder / "run")
    jsonschema.validate(found, schema(), jsonschema.Draft202012Validator)
    assert found["run"]["materials"] == TRAINING
    assert found["run"]["test_materials"] == TESTS
    assert found["front"]
    assert [baseline["name"] for baseline in found["baselines"]] == ["lambert", "bivariate"]
    for entry in entries(found):
        assert list(entry["errors"]) == TRAINING
        assert list(entry["test"]["errors"]) == TESTS
        assert ("parameters" in entry["test"]) == ("parameters" in entry)
        for by_material in entry["test"].get("parameters", {}).values():
            assert list(by_material) == TESTS


def test_what_is_stated_of_test_materials_is_what_their_parameters_give(folder):
    """Evaluated here from the numbers of the export, the measurements and the light."""
    light = light_table(SCENE)
    for entry in entries(exported(folder / "run")):
        test, squares = entry["test"], []
        for name in TESTS:
            material = load_material(f"builtin:{name}")
            if "expression" in entry:
                expression = parse(entry["expression"])
                columns = [test["parameters"][symbol][name] for symbol in expression.parameters]
                model = FormulaModel(expression, np.array(columns).T.reshape(3, len(columns)))
            else:
                model = MODELS[entry["name"]].kept(material).model
            errors = model_errors(Problem([material], light), 0, model)["light"]
            assert errors == pytest.approx(test["errors"][name], rel=1e-6)
            squares += [error**2 for error in errors]
        assert test["error"] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-6)
        assert test["metrics"]["light"] == test["error"]
        assert test["metrics"].keys() == RESIDUALS.keys()


def test_errors_over_materials_combine_as_those_of_targets_do(folder):
    """Of a sum, not only of a mean."""
    light = light_table(SCENE)
    entry = next(b for b in exported(folder / "run")["baselines"] if b["name"] == "bivariate")
    errors = []
    for name in TESTS:
        material = load_material(f"builtin:{name}")
        model = MODELS["bivariate"].kept(material).model
        errors += model_errors(Problem([material], light), 0, model)["light-sum"]
    assert entry["test"]["metrics"]["light-sum"] == pytest.approx(np.sqrt(np.sum(np.square(errors))), rel=1e-9)


def test_the_refit_to_a_training_material_has_the_error_of_the_training(folder):
    """Up to how well a fit finds its optimum: it is another fit, on samples of its own."""
    store, planned = Store.open(folder / "run"), plan(configured(folder))
    jobs = formula_jobs(planned, store)
    assert jobs["lambert"].intervals == CATALOGUE["lambert"].bounds
    for entry in exported(folder / "run")["front"]:
        for name in TRAINING:
            problem = problem_recipe(configured(folder)).of(f"builtin:{name}").build()
            again = transfer(problem, jobs[entry["expression"]])
            known = RESIDUALS["light"].combine(np.array(entry["errors"][name]))
            assert again.fit.error == pytest.approx(known, rel=0.02)
    store.close()


def test_test_materials_change_nothing_that_is_found(folder, without):
    found, plain = exported(folder / "run"), exported(without / "run", [])
    assert "test_materials" not in plain["run"]
    assert not any("test" in entry for entry in entries(plain))
    for entry in entries(found):
        del entry["test"]
    del found["run"]["test_materials"]
    assert without_times(found) == without_times(plain)


class Counting(LocalExecutor):
    """Counts what it computes by label, and notes the fit problems in their order."""

    def __init__(self) -> None:
        super().__init__()
        self.computed: Counter[str] = Counter()
        self.materials: list[tuple[str, ...]] = []

    def wait(self, seconds):
        done = super().wait(seconds)
        for one in done:
            self.computed[one.job.label] += 1
            materials = one.job.recipe.argument.materials
            if self.materials[-1:] != [materials]:
                self.materials.append(materials)
        return done


def test_a_process_holds_one_test_material_after_the_other(without, tmp_path):
    executor, watcher = Counting(), Watching()
    copied(without, tmp_path)
    run_search(tmp_path / "run", configured(tmp_path), watcher, executor).close()
    assert executor.materials == [(reference,) for reference in builtin(TESTS)]
    assert watcher.stages[-1] == ("test materials", watcher.steps - 32)
    assert sum(executor.computed.values()) == watcher.steps - 32


def copied(source: Path, folder: Path) -> None:
    """The run of another folder."""
    (folder / "run").mkdir()
    (folder / "run" / "run.sqlite").write_bytes((source / "run" / "run.sqlite").read_bytes())


@pytest.mark.long
def test_two_worker_processes_find_what_one_process_does(without, tmp_path, monkeypatch):
    """To the last bit, and neither reads what the other has fitted: the settings are of this test alone."""
    fronts = []
    for run, settings in (("spread", DaskSettings(workers=2)), ("alone", LocalSettings())):
        if run == "alone":
            monkeypatch.setenv("GPSEARCH_CACHE", str(tmp_path / "cache"))
        (tmp_path / run).mkdir()
        copied(without, tmp_path / run)
        configuration = small(tmp_path, **changes() | {"fit": {"starts": 65, "restarts": 2, "rounds": 1}})
        with open_executor(settings) as executor:
            store = run_search(tmp_path / run / "run", configuration, executor=executor)
        fronts.append(without_times(result_of(store, configuration).to_json()))
        assert store.quarantined() == []
        store.close()
    assert fronts[0] == fronts[1]


def test_what_is_fitted_is_not_fitted_again(folder, tmp_path):
    """Stopped in the midst of a material, the run goes on with what is missing, and exports the same."""

    class StopsInTheMidst(LocalExecutor):
        tested = 0

        def wait(self, seconds):
            if self._waiting and self._waiting[0][0].kind == "transfer":
                self.tested += 1
            if self.tested > 2:
                raise KeyboardInterrupt
            return super().wait(seconds)

    with pytest.raises(KeyboardInterrupt):
        run_search(tmp_path / "run", configured(tmp_path), executor=StopsInTheMidst())
    store = Store.open(tmp_path / "run")
    assert len(store.transfers()) == 2
    missing, _ = transfer_lanes(plan(configured(tmp_path)), store)
    counting = Counting()
    run_search(tmp_path / "run", configured(tmp_path), executor=counting).close()
    assert sum(counting.computed.values()) == missing
    assert len(store.transfers()) == 2 + missing
    assert without_times(exported(tmp_path / "run")) == without_times(exported(folder / "run"))
    again = Counting()
    run_search(tmp_path / "run", configured(tmp_path), executor=again).close()
    assert again.computed == Counter()
    store.close()


def test_export_tests_a_run_that_was_stopped(folder, tmp_path):
    def stop(event: str) -> None:
        if event == "test materials":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_search(tmp_path / "run", configured(tmp_path), Watching(stop))
    unfinished = exported(tmp_path / "run")
    jsonschema.validate(unfinished, schema(), jsonschema.Draft202012Validator)
    assert {entry["test"]["error"] for entry in entries(unfinished)} == {None}
    result = gpsearch("export", "run", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert without_times(json.loads(result.stdout)) == without_times(exported(folder / "run"))


def test_what_cannot_be_fitted_is_quarantined_until_it_can(folder, tmp_path):
    class Sick(LocalExecutor):
        def wait(self, seconds):
            return [
                Done(one.job, one.index, Failure("raised OSError: stale"))
                if one.job.label == "transfer formulas to fabric"
                else one
                for one in super().wait(seconds)
            ]

    store = run_search(tmp_path / "run", configured(tmp_path), executor=Sick())
    assert {(one.stage, one.reason) for one in store.quarantined()} == {
        ("transfer to fabric", "raised OSError: stale")
    }
    for entry in entries(exported(tmp_path / "run")):
        if "expression" in entry:
            assert entry["test"]["errors"]["fabric"] == [None] * 3
            assert entry["test"]["error"] is None
            assert all(list(values) == ["rough-plastic"] for values in entry["test"]["parameters"].values())
            assert None not in entry["test"]["errors"]["rough-plastic"]
    run_search(tmp_path / "run", configured(tmp_path)).close()
    assert without_times(exported(tmp_path / "run")) == without_times(exported(folder / "run"))


def test_a_run_goes_on_with_other_test_materials(folder, tmp_path):
    """Only the new one is fitted to; the launch says train and test beside each other."""
    copied(folder, tmp_path)
    (tmp_path / "small.yaml").write_text(small_text(**changes(["rough-plastic"])))
    result = gpsearch("launch", "small.yaml", "--run", "run", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    found = json.loads((tmp_path / "run/front.json").read_text())
    assert found["run"]["test_materials"] == ["rough-plastic"]
    whole = exported(folder / "run")
    assert found["run"]["config_sha256"] == whole["run"]["config_sha256"]
    for entry, before in zip(entries(found), entries(whole), strict=True):
        assert entry["test"]["errors"] == {"rough-plastic": before["test"]["errors"]["rough-plastic"]}
    lines = result.stdout.splitlines()
    assert lines[0].split() == ["nodes", "error", "test", "formula"]
    for entry in entries(found):
        shown = f"{entry['error']:7.4f}  {entry['test']['error']:7.4f}  "
        name = entry["name"] if "name" in entry else entry["expression"]
        assert any(shown in line and name[:40] in line for line in lines)


def test_a_run_of_a_version_without_test_materials_goes_on_with_some(without, tmp_path):
    """Its store has the tables of schema version 3 alone, its configuration no such key."""
    copied(without, tmp_path)
    with writing(tmp_path / "run") as store:
        text = "".join(line for line in store.configuration.splitlines(True) if "test_mat" not in line)
        with store.transaction():
            store.set_meta("configuration", text)
        assert "test_materials" not in store.configuration
        assert store.transfers() == {}
    (tmp_path / "small.yaml").write_text(small_text(**changes(["rough-plastic"])))
    result = gpsearch("launch", "small.yaml", "--run", "run", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    found = json.loads((tmp_path / "run/front.json").read_text())
    assert all(entry["test"]["error"] > 0 for entry in entries(found))


def test_a_test_material_that_cannot_be_read_ends_a_launch_before_its_search(tmp_path):
    (tmp_path / "short.binary").write_bytes(b"123")
    text = small_text(**changes() | {"test_materials": ["short.binary"]})
    (tmp_path / "small.yaml").write_text(text)
    for options in ([], ["--check"]):
        result = gpsearch("launch", "small.yaml", "--run", "run", *options, cwd=tmp_path)
        assert (result.returncode, result.stdout) == (2, "")
        assert "short.binary" in result.stderr
    assert Store.open(tmp_path / "run").totals()[0] == 0
