"""The linear parameters in closed form, against SciPy and NumPy."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from fitters.engine.projection import normal_equations, solve_box, sum_of_squares
from tests.random_expressions import random_features

BOX = (-1.5, 2.0)


def value(gram, right, c):
    return 0.5 * c @ gram @ c - right @ c


@pytest.mark.parametrize("k", [1, 2, 3, 4])
@pytest.mark.parametrize("kind", ["regular", "scaled", "equal columns", "zero column", "nearly equal"])
def test_the_box_is_solved_as_scipy_solves_it(k, kind):
    rng = np.random.default_rng(k)
    for _ in range(200):
        a, y = rng.normal(size=(30, k)), 3 * rng.normal(size=30)
        if kind == "scaled":
            a *= 10 ** rng.uniform(-6, 6, k)
        if kind == "equal columns":
            a[:] = a[:, :1]
        if kind == "zero column":
            a[:, 0] = 0
        if kind == "nearly equal":
            a = a[:, :1] + 1e-3 * a
        scale = np.linalg.norm(a, axis=0)
        scale[scale == 0] = 1
        low, high = (bound * rng.uniform(0.1, 3, k) / scale for bound in BOX)
        c = np.empty(k)
        gram, right = a.T @ a, a.T @ y
        assert solve_box(gram, right, low, high, c)
        assert np.all((low <= c) & (c <= high))
        best = lsq_linear(a, y, (low, high), method="bvls", tol=1e-14).x
        assert value(gram, right, c) <= value(gram, right, best) + 1e-9 * (y @ y)


def test_without_bounds_the_solution_is_that_of_the_normal_equations():
    rng = np.random.default_rng(9)
    for k in (1, 2, 3, 4):
        a, y = rng.normal(size=(50, k)), rng.normal(size=50)
        c = np.empty(k)
        assert solve_box(a.T @ a, a.T @ y, np.full(k, -1e30), np.full(k, 1e30), c)
        np.testing.assert_allclose(c, np.linalg.lstsq(a, y, rcond=None)[0], rtol=1e-9)


def test_what_is_not_finite_is_refused():
    low, high, c = np.zeros(2), np.ones(2), np.empty(2)
    for bad in (np.nan, np.inf):
        assert not solve_box(np.array([[bad, 0], [0, 1.0]]), np.ones(2), low, high, c)
        assert not solve_box(np.eye(2), np.array([bad, 1.0]), low, high, c)


@pytest.mark.parametrize("k", [1, 2, 3, 4])
@pytest.mark.parametrize("offset", [False, True])
@pytest.mark.parametrize("n", [50, 1000, 1024, 1025, 5000])
def test_the_projection_is_weighted_least_squares(k, offset, n):
    """SS and c of the addresses that the machine writes to, against `numpy.linalg.lstsq` in float64."""
    rng = np.random.default_rng(n)
    seen = random_features(rng, n)
    columns = np.array([seen["wi.z"] ** p * seen["wh.z"] for p in range(k + 1)], np.float32)
    w = rng.uniform(0, 1, n).astype(np.float32)
    wy = (w * rng.uniform(0, 2, n)).astype(np.float32)
    addresses = [row.ctypes.data for row in columns]
    outputs = np.array([addresses[k] if offset else 0, *addresses[:k]], np.int64)
    gram, right, c = np.zeros((k, k)), np.zeros(k), np.zeros(k)
    normal_equations(outputs, w.ctypes.data, wy.ctypes.data, n, gram, right)
    base = columns[k].astype(float) if offset else np.zeros(n)
    a, y = (columns[:k].astype(float) * w).T, wy - w * base
    np.testing.assert_allclose(gram, a.T @ a, rtol=1e-5)
    np.testing.assert_allclose(right, a.T @ y, rtol=1e-4, atol=1e-5 * np.linalg.norm(right))
    assert solve_box(gram, right, np.full(k, -1e6), np.full(k, 1e6), c)
    found = sum_of_squares(outputs, c, w.ctypes.data, wy.ctypes.data, n, np.empty(1024, np.float32))
    residual = a @ c - y
    assert found == pytest.approx(residual @ residual, rel=1e-5, abs=1e-9)
    best = y - a @ np.linalg.lstsq(a, y, rcond=None)[0]
    assert found <= best @ best * (1 + 1e-4) + 1e-6 * (y @ y)
