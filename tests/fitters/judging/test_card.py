"""Accuracy cards: what they say of models whose errors are known."""

import math

import numpy as np
import pytest

from fitters.expressions import parse
from fitters.fitting import model_errors
from fitters.fitting.problem import Problem
from fitters.grid import CELLS, cell_directions
from fitters.judging.card import Judge
from fitters.judging.metrics import CARD_METRICS, IMAGE_METRICS
from fitters.materials import load_material
from fitters.models import FormulaModel, MeasuredTable
from fitters.rendering import image_map
from fitters.scenes import Scene, light_table

SCENE = Scene(light="studio", resolution=32, light_rows=16)


@pytest.fixture(scope="module")
def judge():
    return Judge(image_map(SCENE), light_table(SCENE), load_material("builtin:glossy-plastic"))


def test_the_measurement_itself_is_without_error(judge):
    card, picture = judge.card(MeasuredTable(judge.material.table))
    np.testing.assert_array_equal(picture.pixels, judge.truth.pixels)
    assert card.metrics.pop("psnr") == math.inf
    assert max(card.metrics.values()) < 1e-6


def test_half_the_light_is_an_l2_error_of_a_half(judge):
    card, _ = judge.card(MeasuredTable(judge.material.table / 2))
    assert card.metrics["l2"] == pytest.approx(0.5, rel=1e-5)
    assert card.metrics["light"] == pytest.approx(0.5, rel=1e-5)


def test_the_light_error_is_that_of_a_baseline(judge):
    model = FormulaModel(parse("p0"), np.full((3, 1), 0.1))
    card, _ = judge.card(model)
    errors = model_errors(Problem([judge.material], judge.light), 0, model)["light"]
    assert card.metrics["light"] == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-5)


def test_every_metric_has_its_value_and_no_picture_metric_is_missing(judge):
    card, _ = judge.card(FormulaModel(parse("p0"), np.full((3, 1), 0.1)))
    assert set(card.metrics) == set(CARD_METRICS) >= set(IMAGE_METRICS)
    assert all(math.isfinite(value) for value in card.metrics.values())


def test_the_worst_region_is_where_the_error_was_put(judge):
    # Only what is seen at grazing angles is wrong: of the sphere the rim.
    w_i, w_o = cell_directions()
    grazing = (np.minimum(w_i[:, 2], w_o[:, 2]) < np.cos(np.radians(75))).reshape(1, CELLS)
    table = judge.material.table.reshape(3, CELLS) * np.where(grazing, 3.0, 1.0)
    card, _ = judge.card(MeasuredTable(table.reshape(judge.material.table.shape).astype(np.float32)))
    assert card.worst.facing > 60
    assert sum(card.worst.model) > sum(card.worst.truth)
    row, column = card.worst.row - 15.5, card.worst.column - 15.5
    assert math.hypot(row, column) > 12
