"""Fits: pure, within bounds, infinite and never an exception where not finite, right where truth is known."""

import subprocess
import sys

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.expressions import parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.evaluation import evaluate_features
from fitters.fitting import FitSettings, Problem, exact_errors, fit_cells, refit_cells
from fitters.fitting.cells import sample
from fitters.scenes import LightTable
from tests.fitters.fitting.conftest import TRUTH, ggx
from tests.random_expressions import random_tree

WIDE = {f"p{i}": (1e-4, 1e3) for i in range(4)}
THOROUGH = FitSettings(restarts=8, rounds=3, evaluations=150, tolerance=1e-7)


@pytest.fixture(scope="module")
def problem(light, shiny):
    return Problem([shiny], light, metric="light", cells=1500, seed=1)


def fitted(text, problem, bounds=WIDE, settings=None):
    return fit_cells(parse(text), problem.sample, problem.metric, bounds, settings)


def test_known_parameters_are_recovered(problem):
    """From data made with GGX: error below 1e-4 on all cells, parameters within 1 %."""
    formula = CATALOGUE["ggx"]
    near = fit_cells(formula.expression, problem.sample, problem.metric, formula.bounds, THOROUGH)
    found = refit_cells(
        formula.expression, problem.full, problem.metric, formula.bounds, near.columns, THOROUGH, evaluations=100
    )
    truths = (TRUTH, TRUTH | {"p2": 0.1, "p1": 0.3}, TRUTH | {"p2": 0.6})
    assert found.errors.max() < 1e-4
    assert exact_errors(formula.expression, problem, found).by_metric["light"].max() < 1e-4
    for target, truth in enumerate(truths):
        for name, value in truth.items():
            assert found.parameters(target)[name] == pytest.approx(value, rel=0.01)


def test_a_linear_formula_is_solved_exactly(problem):
    found = fitted("p0 + p1 * wi.z + p2 * wh.z", problem, {f"p{i}": (-1e6, 1e6) for i in range(3)})
    seen = problem.sample.features
    columns = np.stack([np.ones(len(problem.sample)), seen["wi.z"], seen["wh.z"]])
    for target in range(3):
        w, wy = problem.sample.weights[target].astype(float), problem.sample.targets[target].astype(float)
        a = (columns * w).T
        best = np.linalg.norm(a @ np.linalg.lstsq(a, wy, rcond=None)[0] - wy)
        assert found.errors[target] == pytest.approx(best, rel=1e-4)


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_same_expression_gets_the_same_fit(problem, name):
    formula = CATALOGUE[name]
    first, again = (
        fit_cells(formula.expression, problem.sample, problem.metric, formula.bounds) for _ in range(2)
    )
    np.testing.assert_array_equal(first.values, again.values)
    np.testing.assert_array_equal(first.errors, again.errors)
    assert first.evaluations == again.evaluations


_IN_A_PROCESS = """
import numpy as np
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import fit_cells
from fitters.judging.metrics import RESIDUALS
from fitters.fitting.cells import Cells
from tests.random_expressions import random_features
n = 1500
seen = random_features(np.random.default_rng(5), n)
weights = np.full((2, n), n**-0.5, np.float32)
measured = np.stack([seen["wh.z"] ** 3, seen["wh.z"] ** 90]).astype(np.float32)
cells = Cells(np.arange(n), seen, weights, weights * measured)
formula = CATALOGUE["genbrdf-metal"]
print(fit_cells(formula.expression, cells, RESIDUALS["light"], formula.bounds).values.tobytes().hex())
"""


def test_a_new_process_finds_the_same_bits():
    outputs = [
        subprocess.run([sys.executable, "-c", _IN_A_PROCESS], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert len(outputs[0]) > 50
    assert outputs[0] == outputs[1]


@pytest.mark.parametrize("name", CATALOGUE)
def test_parameters_stay_within_their_bounds(problem, name):
    """Even bounds that the data does not like; a logarithmic coordinate may round by some last digits."""
    formula = CATALOGUE[name]
    for low, high in ((2.0, 3.0), (1e-3, 2e-3), (0.5, 0.5)):
        bounds = dict.fromkeys(formula.bounds, (low, high))
        found = fit_cells(formula.expression, problem.sample, problem.metric, bounds)
        assert np.all(found.values >= low * (1 - 1e-12))
        assert np.all(found.values <= high * (1 + 1e-12))


@pytest.mark.parametrize("bounds", [(-5.0, 5.0), (0.0, 5.0), (-5.0, -1.0)])
def test_bounds_that_are_not_positive_are_searched_as_they_are(problem, bounds):
    found = fitted("p0 * exp(p1 * wh.z)", problem, {"p0": (0, 10), "p1": bounds})
    assert np.all(np.isfinite(found.errors))
    assert np.all((found.values[:, 1] >= bounds[0]) & (found.values[:, 1] <= bounds[1]))


@pytest.mark.parametrize(
    "text",
    [
        "p0 / (wi.z - wi.z)",
        "asin(2)",
        "sqrt(0 - 1)",
        "p0 + asin(2)",
        "p0 * p1 / (wi.z - wi.z)",
        "1 / 0",
        "exp(exp(exp(9)))",
        "pow(0 - 1 - wi.z, p0)",
        "sqrt(0 - p0)",
        "tan(p0) / (p0 - p0)",
    ],
)
def test_a_formula_that_is_not_finite_has_an_infinite_error(problem, text):
    found = fitted(text, problem)
    assert found.error == np.inf
    assert np.all(found.errors == np.inf)
    assert found.names == parse(text).parameters
    exact = exact_errors(parse(text), problem, found)
    assert np.all(exact.by_metric["light"] == np.inf)


def test_wild_trees_never_raise(problem):
    rng = np.random.default_rng(4)
    quick = FitSettings(starts=6, restarts=1, rounds=0, evaluations=10)
    finite = 0
    for _ in range(400):
        tree = random_tree(rng, 7)
        found = fit_cells(tree, problem.sample, problem.metric, WIDE, quick)
        assert found.names == tree.parameters
        assert not np.any(np.isnan(found.errors))
        finite += np.isfinite(found.error)
    assert finite > 100


def test_no_parameters_at_all(problem):
    found = fitted("wi.z * 0.3", problem)
    assert found.names == ()
    assert found.values.shape == (3, 0)
    values = 0.3 * problem.sample.features["wi.z"]
    expected = [
        np.linalg.norm(w * values - t) for w, t in zip(problem.sample.weights, problem.sample.targets, strict=True)
    ]
    np.testing.assert_allclose(found.errors, expected, rtol=1e-5)


@pytest.mark.parametrize(
    "text", ["p0", "p0 * p1", "p0 + p1", "p0 / p1 + p2", "2 * p0", "max(p0, 1e-05)", "p0 - p0 + p1"]
)
def test_a_formula_that_does_not_see_the_cells(problem, text):
    """The best constant c has w c = wy in least squares."""
    found = fitted(text, problem, settings=THOROUGH)
    for target in range(3):
        w, wy = problem.sample.weights[target].astype(float), problem.sample.targets[target].astype(float)
        best = np.linalg.norm(w * (w @ wy) / (w @ w) - wy)
        assert found.errors[target] == pytest.approx(best, rel=1e-4)


def test_a_channel_of_zeros(light, make_material):
    dark = make_material("dark", 0.0, ggx(), 0.0)
    problem = Problem([dark], light, metric="light", cells=500, seed=1)
    found = fitted("p0 * wi.z", problem, {"p0": (0.0, 1.0)})
    assert found.errors[0] == found.errors[2] == 0
    assert found.values[0, 0] == 0
    assert 0 < found.errors[1] < np.inf


@pytest.mark.parametrize("metric", ["light", "compressive", "light-sum"])
def test_a_channel_without_light(light, shiny, metric):
    """A red lamp: what is not lit cannot be wrong."""
    table = light.table.copy()
    table[2] = 0
    red = LightTable(table, (table > 0).any(axis=0), "z" * 32)
    problem = Problem([shiny], red, metric=metric, cells=500, seed=1)
    found = fitted("p0 * wi.z", problem)
    assert np.all(np.isfinite(found.errors))


def test_missing_bounds_are_named(problem):
    with pytest.raises(FittersError, match="p2"):
        fitted("p0 + p2 * wi.z", problem, {"p0": (0, 1)})


def test_exact_errors_are_plain_numpy_over_all_cells(problem, light, shiny):
    found = fitted("p0 / pi + p1 * pow(wh.z, p2)", problem)
    exact = exact_errors(parse("p0 / pi + p1 * pow(wh.z, p2)"), problem, found)
    index = problem.full.index
    smallest = np.inf
    for target in range(3):
        p0, p1, p2 = found.values[target]
        values = p0 / np.pi + p1 * problem.full.features["wh.z"] ** p2
        smallest = min(smallest, values.min())
        t = light.table[target].ravel()[index].astype(float)
        m = shiny.table[target].ravel()[index].astype(float)
        expected = np.linalg.norm(t * (values - m)) / np.linalg.norm(t * m)
        assert exact.by_metric["light"][target] == pytest.approx(expected, rel=1e-5)
        assert exact.by_metric["light-sum"][target] == pytest.approx(np.linalg.norm(t * (values - m)), rel=1e-5)
    assert exact.minimum == pytest.approx(smallest)


def test_the_engine_states_the_error_of_its_parameters(problem):
    for name, formula in CATALOGUE.items():
        found = fit_cells(formula.expression, problem.sample, problem.metric, formula.bounds)
        for target in range(3):
            values = evaluate_features(formula.expression, found.parameters(target), problem.sample.features)
            plain = np.linalg.norm(problem.sample.weights[target] * values - problem.sample.targets[target])
            assert found.errors[target] == pytest.approx(plain, rel=5e-3, abs=2e-5), name


WORK = ("p0 / pi + p1 * pow(wh.z, p2)", "p0 + p1 * exp(-pow(acos(wh.z) / p2, p3))", "p0 * exp(p1 * wh.z * p2)")


@pytest.mark.parametrize("text", WORK)
def test_a_warm_start_only_adds(problem, text):
    """From anywhere, even from nonsense: no target is worse for it."""
    cold = fitted(text, problem)
    rng = np.random.default_rng(7)
    for spread in (0.0, 0.5, 8.0):
        near = {name: column * np.exp(spread * rng.normal(size=3)) for name, column in cold.columns.items()}
        warm = fit_cells(parse(text), problem.sample, problem.metric, WIDE, near=near)
        assert np.all(warm.errors <= cold.errors * (1 + 1e-3))


def test_a_warm_start_leads_where_the_fit_would_not_have_come(problem):
    """One start and no descent worth the name find no lobe; its own parameters do."""
    text = "p0 + p1 * exp(-pow(acos(wh.z) / p2, 2)) * exp(-pow(wi.z / p3, 2))"
    good = fitted(text, problem, settings=THOROUGH)
    poor = FitSettings(starts=1, restarts=1, rounds=0, evaluations=4)
    cold = fit_cells(parse(text), problem.sample, problem.metric, WIDE, poor)
    warm = fit_cells(parse(text), problem.sample, problem.metric, WIDE, poor, near=good.columns)
    assert warm.error < 1.01 * good.error < cold.error


def test_a_fit_far_from_its_bar_is_given_up(problem):
    whole = fitted("p0 * wi.z", problem)
    assert whole.finished
    stopped = fit_cells(parse("p0 * wi.z"), problem.sample, problem.metric, WIDE, bar=whole.error / 10)
    assert not stopped.finished
    assert stopped.standard_error == 0
    assert stopped.evaluations < whole.evaluations
    assert stopped.error == pytest.approx(whole.error, rel=0.2)
    assert stopped.names == whole.names


@pytest.mark.parametrize("text", WORK)
def test_a_fit_that_meets_its_bar_is_what_it_would_have_been(problem, text):
    plain = fitted(text, problem)
    with_bar = fit_cells(parse(text), problem.sample, problem.metric, WIDE, bar=plain.error)
    assert with_bar.finished
    np.testing.assert_array_equal(plain.values, with_bar.values)


def test_the_standard_error_is_that_of_the_sample(problem):
    """The spread of the error over sixty samples. What is smooth over the grid is sampled better than stated."""
    cells = [sample(problem.full, 400, seed) for seed in range(60)]
    for text in ("p0 * wi.z", "p0 / pi + p1 * pow(wh.z, 30)"):
        fits = [fit_cells(parse(text), some, problem.metric, WIDE) for some in cells]
        spread = np.std([found.error for found in fits])
        stated = np.mean([found.standard_error for found in fits])
        assert 0.25 * stated < spread < 2 * stated


def test_all_cells_leave_no_standard_error(problem):
    assert fit_cells(parse("p0 * wi.z"), problem.full, problem.metric, WIDE).standard_error == 0
