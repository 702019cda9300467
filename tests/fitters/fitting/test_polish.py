"""The last polish against SciPy's least squares, and its promises."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from fitters.expressions import parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.evaluation import evaluate_features
from fitters.fitting import FitSettings, Problem, exact_errors, fit_cells
from fitters.fitting.polish import polish


@pytest.fixture(scope="module")
def problem(light, shiny, make_material):
    """GGX of three roughnesses with a bump that no formula of the catalogue has."""

    def bumpy(w_i, w_o):
        return 0.1 + 0.3 * np.exp(-(((w_i + w_o)[..., 2] - 1.2) ** 2) / 0.02)

    return Problem([shiny, make_material("bumpy", bumpy, bumpy, 0.2)], light, metric="light", cells=800, seed=2)


def fitted(name, problem):
    """A formula and its fit by Nelder-Mead alone, in the right valley but not at its end."""
    formula = CATALOGUE[name]
    settings = FitSettings(evaluations=15, tolerance=1e-2)
    return formula, fit_cells(formula.expression, problem.full, problem.metric, formula.bounds, settings)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long) if name == "sgd" else name for name in CATALOGUE]
)
def test_the_polish_ends_where_least_squares_ends(name, problem):
    """SciPy's trust region from the same start, derivatives by differences, to its own last digits."""
    formula, found = fitted(name, problem)
    cells = problem.full
    polished = polish(formula.expression, cells, problem.metric, formula.bounds, found)
    names = formula.expression.parameters
    low, high = (np.array([formula.bounds[name][side] for name in names]) for side in (0, 1))
    exact = exact_errors(formula.expression, problem, polished).by_metric["light"]
    np.testing.assert_allclose(polished.errors, exact, rtol=1e-6, atol=1e-12)
    for target in range(0, len(problem.targets), 2):

        def residuals(x, target=target):
            values = evaluate_features(formula.expression, dict(zip(names, x, strict=True)), cells.features)
            return np.nan_to_num(cells.weights[target] * values - cells.targets[target], nan=1e3, posinf=1e3)

        start = np.clip(list(found.parameters(target).values()), low * (1 + 1e-9), high * (1 - 1e-9))
        best = least_squares(residuals, start, bounds=(low, high), x_scale=np.maximum(start, 1e-6), max_nfev=200)
        assert polished.errors[target] <= 1.001 * np.sqrt(2 * best.cost) + 1e-9, (name, target)


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_polish_never_makes_a_fit_worse_and_keeps_the_bounds(name, problem):
    formula, found = fitted(name, problem)
    before = exact_errors(formula.expression, problem, found).by_metric["light"]
    polished = polish(formula.expression, problem.full, problem.metric, formula.bounds, found)
    assert np.all(polished.errors <= before * (1 + 1e-9))
    for name_, column in polished.columns.items():
        low, high = formula.bounds[name_]
        assert np.all((column >= low * (1 - 1e-9)) & (column <= high * (1 + 1e-9)))


def test_what_is_not_finite_stays_as_it_is(problem):
    expression = parse("p0 / (wi.z - wi.z)")
    found = fit_cells(expression, problem.sample, problem.metric, {"p0": (1e-3, 1.0)})
    polished = polish(expression, problem.full, problem.metric, {"p0": (1e-3, 1.0)}, found)
    assert polished.error == np.inf
    np.testing.assert_array_equal(polished.values, found.values)


def test_a_formula_without_parameters_has_nothing_to_polish(problem):
    expression = parse("wi.z / pi")
    found = fit_cells(expression, problem.sample, problem.metric, {})
    polished = polish(expression, problem.full, problem.metric, {}, found)
    assert polished.values.shape == (len(problem.targets), 0)
    exact = exact_errors(expression, problem, polished).by_metric["light"]
    np.testing.assert_allclose(polished.errors, exact, rtol=1e-6)
