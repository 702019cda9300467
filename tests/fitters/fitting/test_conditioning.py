"""Condition numbers against closed forms, and what a description says of fits that are not to be relied on."""

import numpy as np
import pytest

from fitters.expressions import parse, to_text
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import (
    ConfirmJob,
    DescriptionJob,
    FitJob,
    FitSettings,
    Problem,
    confirm,
    describe,
    refit_cells,
)
from fitters.fitting.cells import Cells
from fitters.fitting.conditioning import conditioning
from fitters.fitting.problem import ORDINARY
from fitters.fitting.warnings import effective_cells

SETTINGS = FitSettings(starts=32, evaluations=20)


def problem_of(material, light):
    return Problem([material], light, metric="light", cells=800, seed=2)


def lobe(base=0.05, height=0.5, exponent=20.0, factor=1.0):
    """Blinn and Phong's, which the random cells of this light judge evenly."""
    return lambda w_i, w_o: factor * (base + height * half_cosine(w_i, w_o) ** exponent)


def half_cosine(w_i, w_o):
    half = w_i + w_o
    return half[:, 2] / np.linalg.norm(half, axis=1)


def lobes(factor=1.0):
    return lobe(factor=factor), lobe(exponent=60.0, factor=factor), lobe(0.02, 2.0, 8.0, factor)


@pytest.fixture(scope="module")
def problem(light, make_material):
    return problem_of(make_material("glossy", *lobes()), light)


def bounds(expression, low=1e-6, high=1e5):
    return dict.fromkeys(expression.parameters, (low, high))


def described(text, problem, intervals):
    job = FitJob((text,), tuple((name, *sides) for name, sides in intervals.items()), SETTINGS)
    confirmed = confirm(problem, ConfirmJob(job))
    return describe(problem, DescriptionJob(job, confirmed.fit))


def conditions(text, problem, **values):
    expression = parse(text)
    near = {name: np.full(3, value) for name, value in values.items()}
    found = refit_cells(
        expression, problem.full, problem.metric, bounds(expression), near, SETTINGS, evaluations=0
    )
    return conditioning(expression, problem.full, bounds(expression), found)


def test_two_linear_parameters_have_the_condition_of_their_correlation(problem):
    """J^T J scaled to a unit diagonal is (1 r; r 1): eigenvalues 1 + |r| and 1 - |r|."""
    found = conditions("p0 + p1 * pow(wh.z, 30)", problem, p0=0.1, p1=0.1)
    for target, one in enumerate(found):
        weights = problem.full.weights[target].astype(np.float64)
        a, b = weights, weights * problem.full.features["wh.z"] ** 30
        r = a @ b / np.sqrt((a @ a) * (b @ b))
        assert one.condition == pytest.approx(np.sqrt((1 + r) / (1 - r)), rel=1e-4)
        assert one.flat == ()


def test_a_product_of_two_parameters_is_one_flat_direction(problem):
    for one in conditions("p0 * p1 * wh.z", problem, p0=0.1, p1=0.1):
        assert one.condition > 1e5
        (flat,) = one.flat
        assert sorted(flat.values()) == pytest.approx([-1, 1], abs=1e-3)


def test_units_do_not_change_a_condition_number(problem, light, make_material):
    scaled = problem_of(make_material("scaled", *lobes(1e6)), light)
    text = "p0 + p1 * pow(wh.z, p2)"
    near = {"p0": 0.1, "p1": 0.1, "p2": 30.0}
    for plain, large in zip(conditions(text, problem, **near), conditions(text, scaled, **near), strict=True):
        assert plain.condition > 2
        assert large.condition == pytest.approx(plain.condition, rel=1e-3)


def test_a_healthy_fit_has_nothing_to_say(problem):
    expression = CATALOGUE["blinn-phong"].expression
    assert described(to_text(expression), problem, CATALOGUE["blinn-phong"].bounds).warnings == ()


def test_parameters_that_trade_off_are_named(light, shiny):
    """Eq. 5 of the genBRDF paper: R0 and the specular scale, since 1 - N.H is next to 0 in the highlight."""
    problem = problem_of(shiny, light)
    published = CATALOGUE["cook-torrance"]
    said = described(to_text(published.expression), problem, published.bounds).warnings
    assert any("p1 and p3 trade off" in sentence and sentence.startswith("shiny") for sentence in said)


def test_a_bound_that_holds_a_fit_back_is_named(problem):
    expression = CATALOGUE["blinn-phong"].expression
    narrow = CATALOGUE["blinn-phong"].bounds | {"p2": (10.0, 30.0)}
    said = [s for s in described(to_text(expression), problem, narrow).warnings if "p2" in s]
    # Of exponents 20, 60 and 8 the first is free.
    assert sorted(said) == [
        "glossy (blue): p2 stands at its bound 10",
        "glossy (green): p2 stands at its bound 30",
    ]


def test_few_cells_and_empty_channels_are_said(light, make_material):
    def peak(w_i, w_o):
        values = np.full(len(w_i), 1e-6)
        values[:2] = 1e3
        return values

    said = described(
        "p0 / pi", problem_of(make_material("peak", peak, 0.2, 0.0), light), {"p0": (1e-6, 1e5)}
    ).warnings
    assert any("peak (red): the light comes from" in sentence for sentence in said)
    assert any("peak (blue): zero wherever there is light" in sentence for sentence in said)


def test_effective_cells_of_equal_shares_are_all_of_them():
    ones = np.ones((1, 50), np.float32)
    assert effective_cells(Cells(np.arange(50), {}, ones, ones), 0) == pytest.approx(50)
    ones = np.eye(1, 50, dtype=np.float32)
    assert effective_cells(Cells(np.arange(50), {}, ones, ones), 0) == pytest.approx(1)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_a_fit_does_not_depend_on_the_units(factor, light, make_material):
    """Neither its error nor its shape; what is linear in it takes up the factor, beyond its bounds."""
    plain = problem_of(make_material("plain", *lobes()), light)
    scaled = problem_of(make_material("scaled", *lobes(factor)), light)
    assert plain.full.units is None
    assert np.all((scaled.full.units >= 0.01 * factor) & (scaled.full.units <= 10 * factor))
    published = CATALOGUE["blinn-phong"]
    found = [described(to_text(published.expression), p, published.bounds) for p in (plain, scaled)]
    np.testing.assert_allclose(found[1].fit.errors, found[0].fit.errors, atol=1e-5)
    np.testing.assert_allclose(found[1].fit.columns["p2"], [20, 60, 8], rtol=1e-3)
    np.testing.assert_allclose(found[1].fit.columns["p1"], factor * np.array([0.5, 0.5, 2.0]), rtol=1e-3)
    assert any("no reflectance in sr^-1" in sentence for sentence in found[1].warnings)
    assert not any("no reflectance" in sentence for sentence in found[0].warnings)


def test_parts_of_a_problem_keep_their_units(light, make_material):
    plain, scaled = make_material("plain", *lobes()), make_material("scaled", *lobes(1e6))
    problem = Problem([plain, scaled], light, metric="light", cells=800, seed=2)
    assert problem.of_material(1).sample.units.tolist() == problem.full.units[3:].tolist()
    assert problem.full.only(np.arange(10)).units is problem.full.units
    found = described("p0", problem.of_material(1), {"p0": (1e-6, 100.0)}).fit
    alone = described("p0", problem_of(plain, light), {"p0": (1e-6, 100.0)}).fit
    np.testing.assert_allclose(found.columns["p0"], 1e6 * alone.columns["p0"], rtol=1e-3)


def test_ordinary_levels_are_never_rescaled(light, make_material):
    for level in (1.01 * ORDINARY[0], 0.99 * ORDINARY[1]):
        assert problem_of(make_material("even", level, level, level), light).full.units is None
