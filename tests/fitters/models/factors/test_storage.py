"""Factors in few bytes: how many, and what is lost."""

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.models.factors import storage
from fitters.models.factors.tables import MicrofacetFactors
from tests.fitters.models.factors import known


@pytest.fixture(scope="module")
def model():
    return known.microfacet()


def test_floats_take_the_papers_bytes_and_lose_a_float(model):
    content = storage.to_floats(model)
    assert len(content) == 3264
    back = storage.from_floats(content)
    for name, values in model.arrays().items():
        np.testing.assert_allclose(back[name], values, rtol=6e-8)


def test_twenty_bits_lose_seven_millionths(model):
    content = storage.to_packed(model)
    assert len(content) == 24 + 810 * 20 // 8
    back = storage.from_packed(content)
    for name in ("D", "F", "G"):
        np.testing.assert_allclose(back[name], np.maximum(model[name], 1e-6), rtol=7e-6)
    np.testing.assert_allclose(back["rho_s"], model["rho_s"], rtol=6e-8)


def test_the_ends_of_the_range_are_exact(model):
    arrays = model.arrays() | {"F": np.where(np.arange(90)[:, None] % 2, 1.0, 1e-6) * np.ones((1, 3))}
    back = storage.from_packed(storage.to_packed(MicrofacetFactors(**arrays)))
    np.testing.assert_allclose(back["F"], arrays["F"], rtol=1e-12)


def test_content_of_another_length_is_refused(model):
    with pytest.raises(FittersError, match="3,263 bytes are no factors, which take 3,264"):
        storage.from_floats(storage.to_floats(model)[:-1])
    with pytest.raises(FittersError, match="were cut or are others"):
        storage.from_packed(b"")


def test_factors_that_are_not_normalised_are_refused(model):
    arrays = model.arrays() | {"D": 2 * model["D"]}
    with pytest.raises(FittersError, match="the largest component is 2"):
        storage.to_packed(MicrofacetFactors(**arrays))
