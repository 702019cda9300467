"""The metrics against closed forms and the papers' equations."""

import numpy as np
import pytest

from fitters.fitting import RESIDUALS, Problem
from fitters.judging.metrics import weighted_median


@pytest.fixture(scope="module")
def cells():
    rng = np.random.default_rng(1)
    return 10 ** rng.uniform(-4, 1, 500), 10 ** rng.uniform(-3, 2, 500)


def error(metric, light, measured, values):
    w = metric.weights(light, measured)
    return np.linalg.norm(w * (values - measured)) / metric.scale(w, measured)


@pytest.mark.parametrize("name", RESIDUALS)
def test_a_perfect_fit_has_no_error(name, cells):
    assert error(RESIDUALS[name], *cells, cells[1]) == 0


@pytest.mark.parametrize("name", ["light", "compressive"])
def test_black_has_error_one_at_any_exposure(name, cells):
    light, measured = cells
    # To the last bit or two: the two lengths are added up from differently rounded numbers.
    assert error(RESIDUALS[name], light, measured, 0 * measured) == pytest.approx(1, rel=1e-15)
    assert error(RESIDUALS[name], 7 * light, 3 * measured, 0 * measured) == pytest.approx(1, rel=1e-14)


def test_the_light_error_is_relative(cells):
    assert error(RESIDUALS["light"], *cells, 1.1 * cells[1]) == pytest.approx(0.1)


def test_compressive_weights_are_those_of_the_factor_paper(cells):
    """w_C = (f(x; log 2) / x)^1.4, eq. 11, f(x; a) = (1 - e^(-a x)) / a, eq. 12, x relative to the median."""
    light, measured = cells
    order = np.argsort(measured)
    share = np.cumsum(light[order]) / light.sum()
    median = measured[order][share >= 0.5][0]
    x = measured / median
    f = (1 - np.exp(-np.log(2) * x)) / np.log(2)
    expected = light**2 * (f / x) ** 1.4
    np.testing.assert_allclose(RESIDUALS["compressive"].weights(light, measured) ** 2, expected, rtol=1e-9)
    assert weighted_median(measured, light) == median


@pytest.mark.parametrize("values", ["spread", "few", "one"])
def test_the_weighted_median_of_many_is_that_of_all_sorted(values):
    rng = np.random.default_rng(0)
    made = {"spread": rng.exponential(size=50_000), "few": rng.integers(0, 3, 50_000) / 2, "one": np.ones(50_000)}
    weights = rng.random(50_000)
    order = np.argsort(made[values])
    heavier = np.cumsum(weights[order]) >= 0.5 * weights.sum()
    assert weighted_median(made[values], weights) == made[values][order][np.argmax(heavier)]


def test_compressive_weights_of_dark_cells_are_the_light(cells):
    light, measured = cells[0], cells[1].copy()
    measured[:10] = 0
    weights = RESIDUALS["compressive"].weights(light, measured)
    np.testing.assert_array_equal(weights[:10], light[:10])
    assert np.all(weights <= light)
    assert np.all(np.isfinite(RESIDUALS["compressive"].weights(light, 0 * measured)))


def test_light_sum_is_the_root_of_equation_4(cells):
    """S' = sum (T f1 - T f2)^2, combined over targets by the L2 norm as section 3.2 of the paper says."""
    light, measured = cells
    values = measured + 0.1
    metric = RESIDUALS["light-sum"]
    assert error(metric, light, measured, values) ** 2 == pytest.approx(np.sum((light * 0.1) ** 2))
    assert metric.combine(np.array([3.0, 4.0])) == pytest.approx(5)


def test_targets_combine_by_root_mean_square():
    assert RESIDUALS["light"].combine(np.array([1.0, 7.0])) == pytest.approx(5)
    assert RESIDUALS["light"].combine(np.array([1.0, np.inf])) == np.inf


@pytest.mark.parametrize("name", RESIDUALS)
def test_the_cells_of_a_problem_carry_the_metric(name, light, shiny):
    """A target's error is || weights f - targets ||, with weights w / s."""
    problem = Problem([shiny], light, metric=name, cells=100, seed=1)
    index = problem.full.index
    for channel in range(3):
        carried = light.table[channel].ravel()[index].astype(np.float64)
        measured = shiny.table[channel].ravel()[index].astype(np.float64)
        expected = error(RESIDUALS[name], carried, measured, 0.3 + 0 * measured)
        found = np.linalg.norm(problem.full.weights[channel] * 0.3 - problem.full.targets[channel].astype(float))
        assert found == pytest.approx(expected, rel=1e-5)
