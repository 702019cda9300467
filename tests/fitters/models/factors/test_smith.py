"""Smith's G of a tabulated D, against closed forms (Walter et al. 2007)."""

import numpy as np
import pytest
from scipy.special import erf

from fitters.grid import bin_centres
from fitters.models.factors.smith import smith

THETA_HALF = bin_centres()[0]
THETA = np.radians(np.arange(90))


def ggx(alpha):
    d = 1 / (np.pi * alpha**2 * np.cos(THETA_HALF) ** 4 * (1 + np.tan(THETA_HALF) ** 2 / alpha**2) ** 2)
    return d, 2 / (1 + np.sqrt(1 + alpha**2 * np.tan(THETA) ** 2))


def beckmann(alpha):
    d = np.exp(-(np.tan(THETA_HALF) ** 2) / alpha**2) / (np.pi * alpha**2 * np.cos(THETA_HALF) ** 4)
    a = 1 / (alpha * np.tan(np.maximum(THETA, 1e-9)))
    return d, 1 / (1 + (erf(a) - 1) / 2 + np.exp(-(a**2)) / (2 * a * np.sqrt(np.pi)))


@pytest.mark.parametrize("distribution", [ggx, beckmann])
@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.7])
def test_shadowing_is_the_closed_form(distribution, alpha):
    d, expected = distribution(alpha)
    np.testing.assert_allclose(smith().shadowing(7.0 * d), expected, atol=2e-3)


@pytest.mark.parametrize("alpha", [0.05, 0.3])
def test_the_norm_is_eq_19(alpha):
    d, _ = ggx(alpha)
    assert smith().norm @ d == pytest.approx(1.0, abs=5e-3)


def test_more_points_resolve_sharp_distributions():
    d, expected = beckmann(0.02)
    worst = [np.abs(smith(points).shadowing(d) - expected).max() for points in (15, 60)]
    assert worst[1] < 2e-3 < worst[0] < 3e-2


def test_the_derivative_is_that_of_the_shadowing():
    d, _ = ggx(0.3)
    g, slope = smith().log_derivative(d)
    np.testing.assert_allclose(g, smith().shadowing(d), rtol=1e-12)
    for m in (0, 30, 70):
        step = 1e-5 * np.eye(90)[m]
        up, down = (np.log(smith().shadowing(d * np.exp(sign * step))) for sign in (1, -1))
        np.testing.assert_allclose(slope[:, m], (up - down) / 2e-5, atol=1e-7)
