"""The error of a model over the samples of an anisotropic measurement."""

import numpy as np
import pytest

from fitters.fitting import Problem, model_errors
from fitters.materials import AnisotropicMaterial
from fitters.materials.utia import SHAPE, sample_directions
from tests.fitters.models.power_iterations.closed_forms import Surface

SURFACE = Surface("beckmann", 0.6, 0.4, 0.5, fresnel=(0.7, 0.5, 0.3))


class Scaled:
    """The surface times a number a channel."""

    def __init__(self, *factors):
        self.factors = np.array(factors)

    def evaluate(self, w_i, w_o):
        return SURFACE.brdf(w_i, w_o) * self.factors


def errors(material, model):
    return model_errors(Problem([material]), 0, model)["cosine"]


@pytest.fixture(scope="module")
def material():
    table = SURFACE.brdf(*sample_directions()).T.reshape(SHAPE).astype(np.float32)
    return AnisotropicMaterial("cloth", table, "test", "0", (0.0, 0.0, 0.0))


def test_samples_lie_where_the_format_says(material):
    """Where they are read back without interpolation."""
    w_i, w_o = sample_directions()
    np.testing.assert_allclose(material.evaluate(w_i, w_o), material.table.reshape(3, -1).T, rtol=1e-6, atol=1e-6)


def test_errors_are_relative_to_the_measurement(material):
    assert errors(material, Scaled(1, 1, 1)) == pytest.approx((0, 0, 0), abs=1e-6)
    assert errors(material, Scaled(2, 0, 1.1)) == pytest.approx((1, 1, 0.1), rel=1e-4)


def test_a_channel_that_is_0_throughout_has_a_finite_error(material):
    table = material.table.copy()
    table[1] = 0
    dark = AnisotropicMaterial("dark", table, "test", "0", (0.0, 0.0, 0.0))
    red, green, blue = errors(dark, Scaled(1, 1, 1))
    assert (red, blue) == pytest.approx((0, 0), abs=1e-6)
    assert 0 < green < np.inf
