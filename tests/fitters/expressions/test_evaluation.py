"""What the grammar sees of two directions, against the vectors themselves."""

import numpy as np
import pytest

from fitters.expressions import Expression, evaluate, parse
from fitters.expressions.evaluation import FEATURES, features
from tests.random_expressions import random_directions

NAMES = ("wi", "wo", "wh", "wr", "wn")


@pytest.fixture(scope="module")
def vectors():
    """The five vectors (n, 3) by name: w_r = 2 (n.w_i) n - w_i, the mirror image of w_i about the normal."""
    w_i, w_o = random_directions(np.random.default_rng(6), 1000)
    normal = np.broadcast_to([0.0, 0.0, 1.0], w_i.shape)
    half = (w_i + w_o) / np.linalg.norm(w_i + w_o, axis=1, keepdims=True)
    mirror = 2 * np.sum(w_i * normal, axis=1, keepdims=True) * normal - w_i
    return {"wi": w_i, "wo": w_o, "wh": half, "wr": mirror, "wn": normal}


@pytest.mark.parametrize("first", NAMES)
@pytest.mark.parametrize("second", NAMES)
def test_a_dot_product_is_that_of_the_vectors(vectors, first, second):
    found = evaluate(Expression("dot", (Expression(first), Expression(second))), {}, vectors["wi"], vectors["wo"])
    np.testing.assert_allclose(found, np.sum(vectors[first] * vectors[second], axis=1), atol=1e-14)


@pytest.mark.parametrize("name", NAMES[:4])
def test_a_component_is_that_of_the_vector(vectors, name):
    found = evaluate(Expression(f"{name}.z"), {}, vectors["wi"], vectors["wo"])
    np.testing.assert_allclose(found, vectors[name][:, 2], atol=1e-14)


def test_features_keep_the_shape_of_the_directions(vectors):
    w_i, w_o = (vectors[name].reshape(10, 20, 5, 3) for name in ("wi", "wo"))
    seen = features(w_i, w_o)
    assert tuple(seen) == FEATURES
    assert {values.shape for values in seen.values()} == {(10, 20, 5)}
    assert evaluate(parse("p0"), {"p0": 2.0}, w_i, w_o).shape == (10, 20, 5)
    assert evaluate(parse("p0 * wi.z"), {"p0": np.ones(5)}, w_i, w_o).shape == (10, 20, 5)


def test_what_is_not_finite_is_returned_and_not_warned_about(vectors):
    w_i, w_o = vectors["wi"], vectors["wo"]
    with np.errstate(all="raise"):
        assert np.all(np.isnan(evaluate(parse("sqrt(0 - 1)"), {}, w_i, w_o)))
        assert np.all(np.isinf(evaluate(parse("1 / (wi.z - wi.z)"), {}, w_i, w_o)))
        assert np.all(np.isnan(evaluate(parse("asin(2)"), {}, w_i, w_o)))
        assert np.all(np.isinf(evaluate(parse("exp(1e5)"), {}, w_i, w_o)))
