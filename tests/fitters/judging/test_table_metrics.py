"""The errors on the table against their definitions, cell by cell."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fitters.errors import FittersError
from fitters.fitting import model_errors
from fitters.fitting.problem import Problem
from fitters.grid import SHAPE, bin_centres, directions
from fitters.judging.metrics import CARD_METRICS, METRICS, Compared
from fitters.models import MeasuredTable

NAMES = ["light", "cosine-log", "cosine-cube-root"]


@pytest.fixture(scope="module")
def few_cells(shiny, light):
    """The material, known in 40 of its cells only, half of them lit."""
    rng = np.random.default_rng(2)
    lit, unlit = shiny.valid & light.lit, shiny.valid & ~light.lit
    chosen = np.concatenate([rng.choice(np.flatnonzero(cells), 20, replace=False) for cells in (lit, unlit)])
    valid = np.zeros(SHAPE, bool)
    valid.ravel()[chosen] = True
    return replace(shiny, valid=valid, table=np.where(valid, shiny.table, 0))


@pytest.mark.parametrize(
    ("name", "curve"),
    [("cosine-log", lambda v: math.log(1 + v)), ("cosine-cube-root", lambda v: v ** (1 / 3))],
)
def test_both_directions_of_every_valid_cell_count_alike(name, curve, few_cells, light):
    values = np.random.default_rng(4).uniform(0, 2, (3, *SHAPE))
    expected = []
    for channel in range(3):
        squares = []
        for cell in zip(*np.nonzero(few_cells.valid), strict=True):
            angles = [centres[i] for centres, i in zip(bin_centres(), cell, strict=True)]
            for direction in directions(*angles):
                f, m = values[channel][cell], float(few_cells.table[channel][cell])
                squares.append((curve(f * direction[2]) - curve(m * direction[2])) ** 2)
        expected.append(math.sqrt(sum(squares) / 80))
    assert METRICS[name].errors(Compared(few_cells, light, values)) == pytest.approx(tuple(expected), rel=1e-6)


def test_the_light_error_is_the_one_that_baselines_are_judged_by(shiny, light):
    values = (1.2 * shiny.table + 0.01).astype(np.float32)
    expected = model_errors(Problem([shiny], light), 0, MeasuredTable(values))["light"]
    assert METRICS["light"].errors(Compared(shiny, light, values)) == pytest.approx(expected, rel=1e-5)


def test_the_measurement_has_no_error_and_cells_that_are_not_valid_do_not_count(few_cells, light):
    values = np.where(few_cells.valid, few_cells.table, 1e9)
    for name in NAMES:
        np.testing.assert_allclose(METRICS[name].errors(Compared(few_cells, light, values)), 0, atol=1e-6)


def test_every_protocol_says_which_cells_count():
    assert set(NAMES) <= set(CARD_METRICS)
    assert all("valid cells" in METRICS[name].protocol for name in NAMES)


def test_values_of_another_shape_are_refused(shiny, light):
    with pytest.raises(FittersError, match=r"values are \(3, 90, 90, 180\)"):
        Compared(shiny, light, shiny.table[0])
