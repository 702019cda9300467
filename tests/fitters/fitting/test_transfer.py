"""A formula fitted to materials that it was not searched on: once on a machine, and from nothing but its text."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from fitters.expressions import parse, to_text
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import FitJob, FitSettings, Problem, exact_errors, transfer
from tests.fitters.fitting.conftest import TRUTH, ggx

MODULE = sys.modules[transfer.__module__]
QUICK = FitSettings(starts=64, restarts=1, rounds=1)


def job(text: str, bounds=None) -> FitJob:
    expression = parse(text)
    bounds = bounds or dict.fromkeys(expression.parameters, (1e-6, 1e5))
    return FitJob((to_text(expression),), tuple((name, *ends) for name, ends in bounds.items()), QUICK)


@pytest.fixture(autouse=True)
def cache_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("GPSEARCH_CACHE", str(tmp_path))
    return tmp_path


@pytest.fixture
def problem(light, shiny):
    return Problem([shiny], light, metric="light", cells=256, confirm_cells=1024, seed=0)


def test_a_formula_finds_what_a_material_was_made_of(problem):
    found = transfer(problem, job(to_text(CATALOGUE["ggx"].expression), CATALOGUE["ggx"].bounds))
    assert found.fit.error < 1e-3
    roughness = found.fit.columns["p2"]
    np.testing.assert_allclose(roughness, [TRUTH["p2"], 0.1, 0.6], rtol=1e-2)


def test_what_is_reported_are_the_errors_of_the_parameters(problem):
    found = transfer(problem, job("p0 / pi + p1 * pow(wh.z, p2)"))
    exact = exact_errors(parse("p0 / pi + p1 * pow(wh.z, p2)"), problem, found.fit).by_metric
    np.testing.assert_array_equal(found.fit.errors, exact["light"])
    assert found.metrics["light"] == found.fit.error == pytest.approx(np.sqrt(np.mean(exact["light"] ** 2)))


def test_it_is_fitted_once_and_comes_back_to_the_last_bit(problem, monkeypatch):
    first = transfer(problem, job("p0 + p1 * wh.z"))

    def fitted_again(*anything):
        raise AssertionError("fitted again")

    monkeypatch.setattr(MODULE, "fit_formula", fitted_again)
    second = transfer(problem, job("p0 + p1 * wh.z"))
    assert second.fit.values.tobytes() == first.fit.values.tobytes()
    assert second.fit.errors.tobytes() == first.fit.errors.tobytes()
    described = replace(first, fit=second.fit)
    assert second == described


@pytest.mark.parametrize("what", ["expression", "bounds", "settings", "material", "metric", "code"])
def test_whatever_else_is_asked_is_fitted(problem, make_material, light, monkeypatch, what):
    known = job("p0 + p1 * wh.z")
    transfer(problem, known)
    fitted = []

    def counted(problem, task):
        fitted.append(task)
        raise KeyboardInterrupt

    monkeypatch.setattr(MODULE, "fit_formula", counted)
    if what == "code":
        monkeypatch.setattr(MODULE, "_code", lambda: "mended")
    material = make_material("shiny", ggx(p1=0.7), ggx(), ggx()) if what == "material" else None
    asked = {
        "expression": job("p0 + p1 * wo.z"),
        "bounds": replace(known, bounds=(("p0", 1e-6, 1.0), ("p1", 1e-6, 1.0))),
        "settings": replace(known, settings=replace(QUICK, starts=65)),
    }.get(what, known)
    metric = "compressive" if what == "metric" else "light"
    materials = [replace(material, sha256="another")] if material else problem.materials
    other = Problem(materials, light, metric=metric, cells=256, confirm_cells=1024, seed=0)
    with pytest.raises(KeyboardInterrupt):
        transfer(other, asked)
    assert fitted


def test_a_formula_that_is_not_finite_has_infinite_errors_also_from_the_cache(problem):
    for _ in range(2):
        found = transfer(problem, job("p0 / (wi.z - wi.z)"))
        assert math.isinf(found.fit.error)
        assert math.isinf(found.metrics["light"])


def test_a_formula_without_parameters_has_none(problem):
    for _ in range(2):
        found = transfer(problem, job("1 / pi"))
        assert (found.fit.names, found.fit.values.shape) == ((), (3, 0))
        assert 0 < found.fit.error < math.inf
