"""Programs in float64: the value of the tree, put together from offset and coefficients."""

import numpy as np

from fitters.backends.double import BLOCK, Double
from fitters.backends.program import lower
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.evaluation import evaluate_features
from tests.random_expressions import random_features, random_tree, wild_parameters


def values(tree, parameters, seen):
    """The values of a program over all its blocks."""
    program = lower(tree)
    engine = Double(program, seen)
    arrays = {name: np.asarray(value) for name, value in parameters.items()}
    scalars = engine.scalars(arrays)
    c = np.array([parameters[name] for name in program.linear])
    parts = []
    with np.errstate(all="ignore"):
        for block in engine.blocks:
            offset, columns = engine.outputs(scalars, block)
            parts.append(offset + c @ columns)
    return np.concatenate(parts)


def test_random_trees_are_evaluated_as_they_stand():
    rng = np.random.default_rng(0)
    close = total = 0
    for _ in range(1500):
        tree, parameters, seen = random_tree(rng, 6), wild_parameters(rng), random_features(rng, 20)
        with np.errstate(all="ignore"):
            plain, found = evaluate_features(tree, parameters, seen), values(tree, parameters, seen)
        finite = np.isfinite(plain) & (np.abs(plain) < 1e250)
        total += finite.sum()
        close += np.sum(np.isclose(plain, found, rtol=1e-7, atol=1e-250)[finite])
    assert total > 15_000
    assert close >= 0.999 * total


def test_blocks_cover_all_cells():
    seen = random_features(np.random.default_rng(1), BLOCK + 17)
    for name, formula in CATALOGUE.items():
        parameters = {
            name: np.sqrt(low * high) if low > 0 else 0.5 for name, (low, high) in formula.bounds.items()
        }
        plain = evaluate_features(formula.expression, parameters, seen)
        np.testing.assert_allclose(values(formula.expression, parameters, seen), plain, rtol=1e-9, err_msg=name)
