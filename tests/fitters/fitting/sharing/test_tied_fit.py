"""Tied fits against SciPy, and what they promise at both ends: everything free, everything shared."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from fitters.errors import FittersError
from fitters.expressions import evaluate, parse
from fitters.expressions.evaluation import evaluate_features
from fitters.fitting.sharing import Sharing, tied_fit
from fitters.grid import cell_directions
from tests.fitters.fitting.sharing.conftest import BOUNDS, LOBE

NAMES = ("p0", "p1", "p2")


@pytest.fixture(scope="module")
def noisy(lobes):
    """Two materials whose six widths all differ, with 5 % of noise: no sharing is exact."""
    first = ((0.2, 0.5, 0.05), (0.1, 0.4, 0.06), (0.3, 0.8, 0.04))
    second = ((0.05, 1.5, 0.02), (0.1, 1.0, 0.03), (0.02, 0.7, 0.02))
    return lobes(first, second, noise=0.05)


def fitted(noisy, *scopes):
    problem, free = noisy
    return tied_fit(LOBE, problem.full, problem.metric, BOUNDS, Sharing(NAMES, scopes), free)


def test_with_everything_free_it_is_the_free_fit(noisy):
    found, free = fitted(noisy, "channel", "channel", "channel"), noisy[1]
    np.testing.assert_allclose(found.errors, free.errors, rtol=1e-6)
    np.testing.assert_allclose(found.values, free.values, rtol=1e-3)


@pytest.mark.parametrize(
    "scopes",
    [
        ("channel", "channel", "material"),
        ("channel", "channel", "set"),
        ("channel", "material", "set"),
        pytest.param(("material", "set", "channel"), marks=pytest.mark.long),
        ("set", "set", "set"),
    ],
)
def test_the_joint_optimum_is_that_of_scipy(noisy, scopes):
    """SciPy's trust region over the stored numbers, its residuals from the tree itself, from all of the starts."""
    problem, free = noisy
    cells, found = problem.full, fitted(noisy, *scopes)
    size = {"channel": 1, "material": 3, "set": 6}
    # Who uses which number, spelt out target by target.
    owners = [
        [(name, target // size[scope]) for name, scope in zip(NAMES, scopes, strict=True)] for target in range(6)
    ]
    stored = sorted({owner for target in owners for owner in target})

    def residuals(logarithms):
        numbers = dict(zip(stored, np.exp(logarithms), strict=True))
        rows = []
        for target, owner in enumerate(owners):
            values = evaluate_features(LOBE, {one[0]: numbers[one] for one in owner}, cells.features)
            rows.append(cells.weights[target] * values - cells.targets[target])
        return np.concatenate(rows)

    best = np.inf
    for example in range(6):
        start = [np.log(free.parameters(example)[name]) for name, _ in stored]
        best = min(best, 2 * least_squares(residuals, start, max_nfev=300).cost)
    assert np.sum(found.errors**2) == pytest.approx(best, rel=1e-5)
    for target, owner in enumerate(owners):
        for name, number in owner:
            first = next(t for t in range(6) if owners[t][NAMES.index(name)] == (name, number))
            assert found.parameters(target)[name] == found.parameters(first)[name]


def test_errors_are_those_of_the_shared_values(noisy):
    problem, _ = noisy
    found = fitted(noisy, "channel", "material", "set")
    w_i, w_o = (w[problem.full.index] for w in cell_directions())
    for target in range(6):
        material, channel = problem.materials[target // 3], target % 3
        light = problem.light.table[channel].ravel()[problem.full.index]
        measured = material.table[channel].ravel()[problem.full.index]
        values = evaluate(LOBE, found.parameters(target), w_i, w_o)
        error = np.linalg.norm(light * (values - measured)) / np.linalg.norm(light * measured)
        assert found.errors[target] == pytest.approx(error, rel=1e-5)


def test_a_formula_that_is_nowhere_finite_has_no_tied_fit(noisy):
    problem, free = noisy
    expression = parse("p0 / (wi.z - wi.z) + p1 * p2")
    sharing = Sharing(NAMES, ("set", "set", "set"))
    assert tied_fit(expression, problem.full, problem.metric, BOUNDS, sharing, free).error == np.inf


def test_numbers_are_counted():
    sharing = Sharing(NAMES, ("channel", "material", "set"))
    assert (sharing.floats, sharing.numbers(1), sharing.numbers(4)) == (5, 5, 12 + 4 + 1)
    for materials in (1, 4):
        slots = sharing.slots(NAMES, 3 * materials)
        np.testing.assert_array_equal(np.unique(slots), np.arange(sharing.numbers(materials)))


def test_a_scope_that_is_none_is_refused():
    with pytest.raises(FittersError, match="channel, material, set"):
        Sharing(("p0",), ("scene",))
