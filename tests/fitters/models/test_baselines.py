"""Baselines judged in a scene: errors that a render would see, and failures as data."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fitters.fitting import RESIDUALS, Problem, model_errors
from fitters.materials import load_material
from fitters.models import BASELINES, FAMILIES, MODELS, MaterialTask, MeasuredTable, summarise
from fitters.scenes import Scene, light_table


@pytest.fixture(scope="module")
def problem() -> Problem:
    """The metal, and the fabric as if nothing were known of its backscattering."""
    metal, fabric = load_material("builtin:metal"), load_material("builtin:fabric")
    table, valid = fabric.table.copy(), fabric.valid.copy()
    table[:, :, 0], valid[:, 0] = 0, False
    light = light_table(Scene(light="studio", resolution=16, light_rows=8))
    return Problem([metal, replace(fabric, table=table, valid=valid)], light, metric="light", cells=256, seed=0)


def test_every_model_is_of_a_family_and_the_measurement_is_no_baseline():
    assert {fitter.family.name for fitter in MODELS.values()} == set(FAMILIES)
    assert set(MODELS) - set(BASELINES) == {"measured"}


def test_the_measurement_itself_has_no_error(problem):
    errors = model_errors(problem, 0, MeasuredTable(problem.materials[0].table))
    assert errors.keys() == RESIDUALS.keys()
    assert all(error < 1e-6 for channels in errors.values() for error in channels)


def test_a_fit_is_judged_by_every_metric(problem):
    judged = summarise(problem, MaterialTask("bivariate", 0))
    assert judged.errors.keys() == RESIDUALS.keys()
    assert all(0 < error < 0.1 for error in judged.errors["light"])
    assert (judged.floats, judged.warnings) == (24300, ())
    assert judged.fit_seconds > 0
    assert judged.cost_ns > 0


def test_a_material_that_cannot_be_fitted_is_judged_infinitely_bad_with_the_reason(problem):
    judged = summarise(problem, MaterialTask("power-iterations", 1))
    assert judged.errors == dict.fromkeys(RESIDUALS, (math.inf,) * 3)
    assert (judged.floats, judged.cost_ns) == (0, 0.0)
    (reason,) = judged.warnings
    assert reason.startswith("fabric: no cell with theta_diff below 1 degree is valid")


def test_warnings_name_the_material(problem):
    judged = summarise(problem, MaterialTask("power-iterations", 0))
    assert np.isfinite(judged.errors["light"]).all()
    assert judged.warnings
    assert all(warning.startswith("metal: ") for warning in judged.warnings)
