"""The objective of eq. 7: weights, folding, derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from fitters.errors import FittersError
from fitters.grid import SHAPE
from fitters.materials import load_material
from fitters.models.factors.problems import GFromD, IndependentG, Naive
from fitters.models.factors.samples import LIMIT, geometry, samples
from fitters.models.factors.smith import smith
from tests.fitters.models.factors import known


@pytest.fixture(scope="module")
def plastic():
    """A material with holes: cells that are not valid, a different one on either side of phi_diff = 90 degrees."""
    whole = load_material("builtin:rough-plastic")
    valid = whole.valid & (np.random.default_rng(3).random(SHAPE) < 0.9)
    return replace(whole, valid=valid, table=np.where(valid, whole.table, 0).astype(np.float32))


def unknowns(seed, size):
    random = np.random.default_rng(seed)
    x = np.concatenate([[0.05], np.log(random.uniform(0.2, 1.0, size - 1))])
    x[1:91] -= np.linspace(0, 5, 90)
    return x


@pytest.mark.parametrize("channel", [0, 2])
def test_the_weights_are_those_of_the_paper(plastic, channel):
    expected = known.weights(plastic, channel)
    found = samples(plastic, folded=False)[channel]
    at = found.geometry
    row = np.repeat(np.arange(8100), np.diff(at.offset))
    azimuth = np.arange(len(at)) - at.offset[row] + at.first.ravel()[row]
    spread = np.zeros((8100, 180))
    spread[row, azimuth] = found.weights
    np.testing.assert_allclose(spread.reshape(SHAPE), expected, rtol=2e-4, atol=1e-12 * expected.max())


def test_no_sample_lies_beyond_89_degrees():
    at = geometry(SHAPE[2])
    for node, part in ((at.node_i, at.part_i), (at.node_o, at.part_o)):
        assert np.radians((node + part.astype(float)).max()) <= LIMIT + 1e-6


@pytest.mark.parametrize("channel", range(3))
def test_folding_leaves_the_objective_as_it_is(plastic, channel):
    model = known.microfacet()
    x = np.concatenate(
        [
            model["rho_d"][[channel]],
            np.log(model["rho_s"][channel] * model["D"][:, channel]),
            np.log(model["F"][:, channel]),
            np.log(model["G"][:, channel]),
        ]
    )
    expected = known.objective(plastic, channel, model)
    for folded in (True, False):
        found = samples(plastic, folded=folded)[channel]
        assert IndependentG(found, 0.0).objective(x) + found.constant == pytest.approx(expected, rel=1e-4)


def problem(name, plastic):
    if name == "naive":
        return Naive(samples(plastic, folded=False)[1]), 361
    folded = samples(plastic)[1]
    return (IndependentG(folded, 1e-3), 271) if name == "independent-g" else (GFromD(folded, smith()), 181)


@pytest.mark.parametrize("name", ["independent-g", "g-from-d", "naive"])
def test_the_gradient_is_that_of_the_objective(plastic, name):
    posed, size = problem(name, plastic)
    x = unknowns(5, size)
    value, gradient, _ = posed.normal_equations(x)
    assert value == pytest.approx(posed.objective(x), rel=1e-9)
    expected = approx_fprime(x, posed.objective, 1e-6) / 2
    np.testing.assert_allclose(gradient, expected, rtol=1e-3, atol=1e-5 * np.abs(expected[1:]).max())


@pytest.mark.parametrize("name", ["independent-g", "g-from-d", "naive"])
def test_the_matrix_is_the_hessian_where_the_residual_is_zero(plastic, name):
    posed, size = problem(name, plastic)
    x = unknowns(6, size)
    # Values that the model meets exactly: then the Gauss-Newton matrix is half the Hessian.
    at = posed.samples
    exact = replace(at, values=fitted_values(posed, x))
    posed = replace(posed, samples=exact, **({"smoothing": 0.0} if name == "independent-g" else {}))
    _, _, matrix = posed.normal_equations(x)
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-9)
    random = np.random.default_rng(7)
    for _ in range(5):
        step = 1e-4 * random.standard_normal(size)
        curved = posed.objective(x + step) + posed.objective(x - step)
        assert 2 * step @ matrix @ step == pytest.approx(curved, rel=2e-2)


def fitted_values(posed, x):
    """What the model says at the samples: the derivative of the objective by the values gives it."""
    at = posed.samples.geometry
    row = np.repeat(np.arange(8100), np.diff(at.offset))
    d, f = np.exp(x[1:91]), np.exp(x[91:181])
    base = d[row // 90] * f[row % 90]
    if isinstance(posed, Naive):
        azimuth = np.arange(len(at)) - at.offset[row] + at.first.ravel()[row]
        return (x[0] + base * np.exp(x[181:])[azimuth]).astype(np.float32)
    g = posed.smith.shadowing(d) if isinstance(posed, GFromD) else np.exp(x[181:])
    g_i, g_o = (
        np.interp(n + p.astype(float), np.arange(90), g)
        for n, p in ((at.node_i, at.part_i), (at.node_o, at.part_o))
    )
    return (x[0] + base * g_i * g_o / at.cosines).astype(np.float32)


def test_a_material_without_a_sample_is_refused(plastic):
    valid = np.zeros(SHAPE, np.bool_)
    valid[89, 89, 90] = True
    lonely = replace(plastic, name="lonely", valid=valid, table=np.zeros_like(plastic.table))
    with pytest.raises(FittersError, match="lonely: no valid cell has both directions within 89 degrees"):
        samples(lonely)
