"""Sampled cells stand for all of them."""

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.fitting import Problem
from fitters.fitting.cells import sample


@pytest.fixture(scope="module")
def full(light, shiny):
    return Problem([shiny], light, metric="light", cells=10, seed=0).full


def test_weighted_sums_are_unbiased(full):
    """The mean over seeds of sampled sums of squares is the sum over all cells, within four standard errors."""
    names = ("weights", "targets")
    exact = np.array([np.sum(np.square(getattr(full, name), dtype=float), axis=1) for name in names])
    sums = np.array(
        [
            [np.sum(np.square(getattr(drawn, name), dtype=float), axis=1) for name in names]
            for drawn in (sample(full, 200, seed) for seed in range(200))
        ]
    )
    deviation = np.abs(sums.mean(axis=0) - exact) / (sums.std(axis=0) / np.sqrt(len(sums)) + 1e-9 * exact)
    assert deviation.max() < 4


def test_a_sample_is_a_function_of_its_seed(full):
    first, again, other = (sample(full, 200, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.index, again.index)
    np.testing.assert_array_equal(first.weights, again.weights)
    assert not np.array_equal(first.weights, other.weights)


def test_a_sample_is_of_about_the_size_wanted_and_draws_no_cell_twice(full):
    for count in (1, 10, 500, len(full) - 1):
        drawn = sample(full, count, 3)
        assert 0.3 * count <= len(drawn) <= count
        assert len(set(drawn.index)) == len(drawn)
        assert set(drawn.index) <= set(full.index)


def test_all_cells_are_taken_where_there_are_no_more(full):
    for count in (len(full), len(full) + 1, 10**9):
        assert sample(full, count, 1) is full


def test_the_problem_covers_lit_valid_cells_and_targets_in_order(light, shiny, make_material):
    problem = Problem([shiny, make_material("flat", 1.0, 0.5, 0.1)], light, metric="light", cells=50, seed=1)
    np.testing.assert_array_equal(problem.full.index, np.flatnonzero((light.lit & shiny.valid).ravel()))
    assert problem.targets[:4] == (("shiny", "red"), ("shiny", "green"), ("shiny", "blue"), ("flat", "red"))
    assert problem.full.weights.shape == problem.full.targets.shape == (6, len(problem.full))


def test_materials_must_be_there_and_have_distinct_names(light, shiny):
    for materials in ([], [shiny, shiny]):
        with pytest.raises(FittersError, match="materials"):
            Problem(materials, light, metric="light", cells=50, seed=1)


def test_the_hash_of_a_problem_tells_problems_apart(light, shiny):
    keys = {
        Problem([shiny], light, metric=metric, cells=cells, seed=seed).sha256
        for metric, cells, seed in (("light", 50, 1), ("light", 50, 2), ("light", 60, 1), ("compressive", 50, 1))
    }
    assert len(keys) == 4


def test_a_sample_begins_with_a_smaller_one(full):
    """Whose weighted sums are unbiased too, and whose cells are the first of the larger."""
    exact = np.sum(np.square(full.targets, dtype=float), axis=1)
    sums = []
    for seed in range(200):
        drawn = sample(full, 400, seed)
        assert drawn.coarse is not None
        assert drawn.coarse.weights.shape == drawn.coarse.targets.shape
        assert 0.3 * len(drawn) / 4 < drawn.coarse.weights.shape[1] <= 100
        sums.append(np.sum(np.square(drawn.coarse.targets, dtype=float), axis=1))
        m = drawn.coarse.weights.shape[1]
        lit = drawn.weights[:, :m] > 0
        np.testing.assert_allclose(
            (drawn.targets[:, :m][lit] / drawn.weights[:, :m][lit]),
            (drawn.coarse.targets[lit] / drawn.coarse.weights[lit]),
            rtol=1e-4,
        )
    deviation = np.abs(np.mean(sums, axis=0) - exact) / (np.std(sums, axis=0) / np.sqrt(len(sums)) + 1e-9 * exact)
    assert deviation.max() < 4


def test_draws_add_up(full):
    drawn = sample(full, 500, 1)
    assert drawn.draws is not None
    assert drawn.draws.sum() == 500
    assert full.draws is None
