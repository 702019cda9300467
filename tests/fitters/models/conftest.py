"""Every kind of model, fitted to a glossy and a rough material, and one to an anisotropic surface."""

import time

import numpy as np
import pytest

from fitters.expressions import parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import FitSettings, Problem, fit_cells
from fitters.grid import CELLS, SHAPE, above_horizon
from fitters.materials import load_material
from fitters.models import Fitted, MaterialFit, MeasuredTable, factors, power_iterations
from fitters.models.factors import solving
from fitters.models.formula import formula_models
from fitters.scenes import LightTable
from tests.fitters.models.power_iterations.closed_forms import Surface

GLOSSY, ROUGH = "builtin:glossy-plastic", "builtin:rough-plastic"
ONE_SIDED = "p0 / pi + p1 * wi.z * pow(wh.z, p2)"
BRUSHED = Surface("ggx", 0.5, 0.2, 0.6, fresnel=(0.9, 0.6, 0.3))

FITS = {
    "measured-table": lambda material: MeasuredTable(material.table),
    "ggx": lambda material: _formula(CATALOGUE["ggx"].expression, CATALOGUE["ggx"].bounds, material),
    "cook-torrance": lambda material: _formula(
        CATALOGUE["cook-torrance"].expression, CATALOGUE["cook-torrance"].bounds, material
    ),
    "not reciprocal": lambda material: _formula(
        parse(ONE_SIDED), dict.fromkeys(("p0", "p1", "p2"), (1e-4, 1e3)), material
    ),
    "bivariate": lambda material: factors.fit_bivariate(material).model,
    "npf-independent-g": lambda material: _factors(factors.fit_independent_g, material, only=("slices",)),
    "npf-g-from-d": lambda material: _factors(factors.fit_g_from_d, material),
    "npf-naive": lambda material: _factors(factors.fit_naive, material),
    "power-iterations": lambda material: power_iterations.extract(material).model,
    "power-iterations-anisotropic": lambda material: power_iterations.extract_anisotropic(material).model,
}
MODELS = [(name, material) for name in FITS for material in (GLOSSY, ROUGH)] + [
    ("power-iterations-anisotropic", "brushed")
]


def _factors(method, material, **how):
    """After few steps: that factors are fitted well is tested elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        for steps in ("COARSE_STEPS", "FINE_STEPS"):
            patch.setattr(solving, steps, 5)
        return method(material, **how).model


def _formula(expression, bounds, material):
    """Fitted on a few thousand cells, all lit alike."""
    table = np.zeros((3, CELLS), np.float32)
    lit = np.random.default_rng(0).choice(np.flatnonzero(above_horizon().ravel()), 4000, replace=False)
    table[:, lit] = 1e-3
    table = table.reshape(3, *SHAPE)
    light = LightTable(table, (table > 0).any(axis=0), "c" * 32)
    problem = Problem([material], light, metric="compressive", cells=1000, seed=0)
    began = time.perf_counter()
    found = fit_cells(expression, problem.sample, problem.metric, bounds, FitSettings(starts=64))
    return formula_models(expression, found, time.perf_counter() - began)[0]


@pytest.fixture(scope="session")
def fitted():
    """A model by name and material, each fitted once."""
    known = {}

    def find(name, material):
        if (name, material) not in known:
            taken = BRUSHED.brdf if material == "brushed" else load_material(material)
            known[name, material] = FITS[name](taken)
        return known[name, material]

    return find


@pytest.fixture(params=MODELS, ids=lambda pair: f"{pair[0]} of {pair[1].removeprefix('builtin:')}")
def model(request, fitted):
    return fitted(*request.param)


def save(model, path):
    """Saves a model as a fit of it to one material would be."""
    Fitted(model.kind, {"material": MaterialFit(model)}, "", {}, {}, model.fit_seconds).save(path)
