"""Models fitted to a glossy and a rough material under a light of few cells, each once."""

import numpy as np
import pytest

from fitters.fitting import Problem
from fitters.grid import CELLS, SHAPE, above_horizon
from fitters.materials import load_material
from fitters.models import MODELS, Fitted, MaterialFit
from fitters.models.factors import solving
from fitters.scenes import LightTable
from fitters.testing.models import QUICK

GLOSSY, ROUGH = "builtin:glossy-plastic", "builtin:rough-plastic"


@pytest.fixture(scope="session")
def problem_of():
    """The problem of a material by its reference, in 4,000 cells that are all lit alike."""
    table = np.zeros((3, CELLS), np.float32)
    lit = np.random.default_rng(0).choice(np.flatnonzero(above_horizon().ravel()), 4000, replace=False)
    table[:, lit] = 1e-3
    table = table.reshape(3, *SHAPE)
    light = LightTable(table, (table > 0).any(axis=0), "c" * 32)

    def make(material):
        return Problem([load_material(material)], light, metric="compressive", cells=300, confirm_cells=600)

    return make


@pytest.fixture(scope="session")
def fitted(problem_of):
    """A model by its name in the registry and a material."""
    known = {}

    def find(name, material):
        if (name, material) not in known:
            fitter = MODELS[name]
            if fitter.together:
                known[name, material] = fitter.fit(problem_of(material), settings=QUICK).model
            else:
                known[name, material] = _few_steps(fitter, load_material(material))
        return known[name, material]

    return find


def _few_steps(fitter, material):
    """A model after few steps: that factors are fitted well is tested elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        for steps in ("COARSE_STEPS", "FINE_STEPS"):
            patch.setattr(solving, steps, 5)
        return (fitter.quick or fitter.fit_material)(material).model


def save(model, path):
    """Saves a model as a fit of it to one material would be."""
    Fitted(model.kind, {"material": MaterialFit(model)}, "", {}, {}, model.fit_seconds).save(path)
