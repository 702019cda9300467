"""`gpsearch chart`: on a small run, from the command to its files."""

import csv
import json
from pathlib import Path

import pytest

from fitters.expressions import parse
from fitters.judging.timing import coherent, incoherent
from gpsearch.pictures.chart import measuring
from gpsearch.run import Store, result_of
from tests.gpsearch.pictures.chart.test_charts import traces
from tests.gpsearch.small import gpsearch, make_store, run_search, small

FILES = ("chart.png", "chart.svg", "chart.html", "chart.csv")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("chart")
    configuration = small(folder, budget={"generations": 2}, baselines=["lambert", "bivariate"])
    run_search(folder / "run", configuration).close()
    make_store(folder / "empty", configuration.text())
    return folder


def test_a_run_is_charted(folder, monkeypatch):
    monkeypatch.setattr(measuring, "incoherent", lambda: incoherent(20_000))
    monkeypatch.setattr(measuring, "coherent", lambda: coherent(20_000))
    result = gpsearch("chart", "run", "-o", "out/charts", "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    report = json.loads(result.stdout)
    charts = folder / "out" / "charts"
    assert sorted(path.name for path in charts.iterdir()) == sorted(FILES)
    assert all((charts / name).stat().st_size > 500 for name in FILES)

    store = Store.open(folder / "run")
    exported = result_of(store, small(folder, baselines=["lambert", "bivariate"])).to_json()
    store.close()
    expected = {member["id"]: member for member in exported["front"]}
    expected |= {baseline["name"]: baseline for baseline in exported["baselines"]}
    with (charts / "chart.csv").open(newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert list(rows) == [*expected, "measured"] == [model["name"] for model in report["models"]]
    for name, entry in expected.items():
        row = rows[name]
        assert float(row["error"]) == entry["error"]
        assert row["expression"] == entry.get("expression", "")
        assert int(row["floats"]) == entry.get("floats", 3 * len(parse(row["expression"] or "1").parameters))
        assert float(row["ns"]) > report["empty_ns"] > 0
        assert float(row["fit_seconds"]) > 0
    measured = rows["measured"]
    assert (measured["error"], measured["floats"], measured["non_dominated"]) == ("0.0", "4374000", "True")

    formulas = {about[2] for trace in traces(charts / "chart.html") for about in trace.get("customdata") or []}
    assert formulas == {entry.get("expression", "") for entry in expected.values()} | {""}


def test_the_errors_on_test_materials_are_those_of_the_export(tmp_path, monkeypatch):
    monkeypatch.setattr(measuring, "incoherent", lambda: incoherent(20_000))
    monkeypatch.setattr(measuring, "coherent", lambda: coherent(20_000))
    configuration = small(tmp_path, test_materials=["builtin:fabric"], budget={"generations": 1})
    store = run_search(tmp_path / "run", configuration)
    exported = result_of(store, configuration).to_json()
    store.close()
    result = gpsearch("chart", "run", "--json", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    report = json.loads(result.stdout)
    assert report["test_materials"] == ["fabric"]
    expected = {entry.get("id") or entry["name"]: entry["test"]["error"] for entry in exported["front"]}
    expected |= {entry["name"]: entry["test"]["error"] for entry in exported["baselines"]} | {"measured": 0.0}
    assert {model["name"]: model["test_error"] for model in report["models"]} == expected
    with (tmp_path / "run" / "chart.csv").open(newline="") as file:
        assert {row["name"]: float(row["test_error"]) for row in csv.DictReader(file)} == expected


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere",), "nowhere: no run here"),
        (("empty",), "empty: its front is empty, the run was stopped before"),
        (("run", "-o", "run/run.sqlite"), "run/run.sqlite: cannot be made"),
        (("run", "-o", "run/run.sqlite/charts"), "choose another -o"),
    ],
)
def test_bad_input_is_one_message_and_exit_status_2(folder, arguments, words):
    result = gpsearch("chart", *arguments, cwd=folder)
    assert (result.returncode, result.stdout) == (2, "")
    assert words in result.stderr
    assert "Traceback" not in result.stderr
