"""What a run found: printed and read without a loss, its models at hand, and shown to a reader."""

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gpsearch
from fitters.errors import FittersError
from fitters.materials import load_material
from gpsearch import GpsearchError, Result
from gpsearch.exports import schema
from tests.gpsearch.entries import baseline, formula, on_tests, result
from tests.gpsearch.small import run_search, small

VERSION_1 = Path(__file__).with_name("front-1.json")
"""As the first version of the schema was written, with test materials."""


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> Result:
    folder = tmp_path_factory.mktemp("result")
    changes = {"test_materials": ["builtin:fabric"], "baselines": ["lambert", "bivariate"]}
    run_search(folder / "run", small(folder, budget={"generations": 2}, **changes)).close()
    return gpsearch.load_run(folder / "run")


def test_a_result_is_printed_and_read_back_equal(loaded, tmp_path):
    (tmp_path / "front.json").write_text(loaded.to_text())
    read = Result.read(tmp_path / "front.json")
    assert read == loaded
    assert read.to_text() == loaded.to_text()
    assert Result.from_json(loaded.to_json()) == loaded
    jsonschema.validate(loaded.to_json(), schema(), jsonschema.Draft202012Validator)
    assert len(loaded.run.problem_sha256) == 64


def test_a_file_of_version_1_reads_and_prints_as_it_is():
    read = Result.read(VERSION_1)
    assert (len(read.formulas), [one.name for one in read.baselines]) == (2, ["lambert", "bivariate"])
    assert read.run.problem_sha256 is None
    assert read.to_text() == VERSION_1.read_text()


ERRORS = st.one_of(st.none(), st.floats(0, allow_nan=False, allow_infinity=False))


@given(ERRORS, ERRORS, st.floats(0, allow_nan=False, allow_infinity=False))
def test_every_number_comes_back_to_the_last_bit(error, test_error, found):
    tested = replace(baseline("table", error), test=on_tests(test_error))
    made = result(formula("12345678", found, cost_ns=found), tested)
    text = made.to_text()
    read = Result.from_json(json.loads(text))
    assert (read, read.to_text()) == (made, text)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"schema": "gpsearch-front/2"}, "its `schema` is not gpsearch-front/1"),
        ({"front": [{}]}, "not a result of a run: required field missing"),
        ({"run": {"name": "x"}}, "not a result of a run: required field missing"),
    ],
)
def test_what_is_no_result_is_refused(change, words):
    with pytest.raises(GpsearchError, match=words):
        Result.from_json({**result().to_json(), **change})


def test_a_file_that_is_none_is_refused(tmp_path):
    (tmp_path / "front.json").write_text("{")
    for name in ("front.json", "missing.json"):
        with pytest.raises(GpsearchError, match=f"{name}: cannot be read as front.json"):
            Result.read(tmp_path / name)


def test_models_evaluate(loaded):
    up, aside = np.array([[0.0, 0.0, 1.0]]), np.array([[0.6, 0.0, 0.8]])
    lambert = loaded.model("lambert", "metal").evaluate(up, aside)
    assert lambert == pytest.approx(np.array([loaded.entry("lambert").parameters["p0"]["metal"]]) / np.pi)
    on_test = loaded.model("lambert", "fabric").evaluate(up, aside)
    assert on_test == pytest.approx(np.array([loaded.entry("lambert").test.parameters["p0"]["fabric"]]) / np.pi)
    for name in (loaded.formulas[-1].id, "bivariate"):
        assert loaded.model(name, "metal").evaluate(up, aside).shape == (1, 3)


def test_a_model_that_is_not_there_is_named(loaded):
    with pytest.raises(GpsearchError, match=r"there is no model 'gxg'; there are .*lambert, bivariate"):
        loaded.model("gxg", "metal")
    with pytest.raises(GpsearchError, match="no model is of 'gold'; there are metal, fabric"):
        loaded.model("lambert", "gold")
    unfitted = result(replace(baseline("ggx", 0.1, "formula", expression="p0"), test=on_tests(None)))
    with pytest.raises(FittersError, match="ggx: it could not be fitted to b"):
        unfitted.model("ggx", "b")


def test_a_result_that_was_read_takes_the_material_for_a_table(loaded):
    read = Result.from_json(loaded.to_json())
    with pytest.raises(GpsearchError, match=r"front.json does not say where the materials are; load the run"):
        read.model("bivariate", "metal")
    assert read.model("bivariate", load_material("builtin:metal")).floats == read.entry("bivariate").floats


def test_a_notebook_shows_a_table_in_which_nothing_is_markup():
    made = result(formula("12345678", 0.25, expression="p0 <b>"), baseline("<i>", None), name="<run>")
    html = made._repr_html_()
    assert "<code>p0 &lt;b&gt;</code>" in html
    assert "&lt;run&gt;" in html
    assert "&lt;i&gt;" in html
    assert "0.2500" in html
    assert "not fitted" in html
    assert "<b>" not in html.replace("<tbody>", "")


def test_the_text_has_the_front_among_published_formulas_and_the_tables_below():
    made = result(
        formula("12345678", 0.25, 11),
        baseline("ggx", 0.3, "formula", nodes=9, expression="p0"),
        baseline("bivariate", 0.1, floats=24300),
        baseline("naive", None, warnings=("a: too dark",)),
    )
    assert repr(made).splitlines() == [
        "nodes    error  formula",
        "    9   0.3000  [ggx, refitted]",
        "   11   0.2500  p0",
        "    -   0.1000  [bivariate, 24,300 floats a material]",
        "    -        -  [naive, not fitted: a: too dark]",
    ]


def test_the_package_offers_what_a_user_needs():
    assert set(gpsearch.__all__) == {
        "Baseline",
        "FoundFormula",
        "GpsearchError",
        "Result",
        "__version__",
        "load_run",
    }
    assert set(gpsearch.__all__) <= set(dir(gpsearch))
    with pytest.raises(AttributeError, match="no attribute 'launch'"):
        gpsearch.launch  # noqa: B018
