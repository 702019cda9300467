"""Our fits reach the errors of an independent program (`reference_fits` of the shared data).

That program tried 48 random restarts per channel. Measured with the settings below on all eight materials,
catalogue bounds or wider: within 1 % of it or below on 24 of 24 channels for ct-floor and ggx, on 24 for metal
with wide bounds; ct on 24 (4 of them below); dielectric on 17, where the published optimum is a corner
(alpha about 1e-17 with beta about 1e5) or the restarts end in another valley.
"""

import numpy as np
import pytest

from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import FitSettings, Problem, exact_errors, fit_cells, refit_cells
from fitters.grid import SHAPE
from fitters.materials.material import from_samples
from fitters.scenes import LightTable
from tests.reference_scene import needs_shared_data, published, reference_table, surrogates

MATERIALS = ("steel", "pvc", "maroon-plastic")
THOROUGH = FitSettings(restarts=16, rounds=4, evaluations=100)

# As wide as the independent program's, which states only 0 < R0 <= 1 and R0 >= 0.01 for ct-floor.
MODELS = {
    "ct-floor": ("cook-torrance", {"p0": (0, 1e3), "p1": (0, 1e12), "p2": (1e-4, 10), "p3": (1e-2, 1)}),
    "ggx": ("ggx", {"p0": (0, 1e3), "p1": (0, 1e12), "p2": (1e-4, 10), "p3": (1e-12, 1)}),
    "metal": ("genbrdf-metal", {"p0": (1e-12, 1e6), "p1": (0, 1e12), "p2": (1e-12, 1e6), "p3": (1e-6, 1e3)}),
}

pytestmark = [needs_shared_data, pytest.mark.long]


@pytest.fixture(scope="module")
def problem():
    table = reference_table().astype(np.float32).reshape(3, *SHAPE)
    materials = [
        from_samples(
            name, samples.reshape(3, *SHAPE), source="surrogate", sha256=name, all_negative_is_missing=True
        )
        for name, samples in surrogates(MATERIALS).items()
    ]
    light = LightTable(table, (table > 0).any(axis=0), "reference")
    return Problem(materials, light, metric="light", cells=16384, seed=1)


@pytest.mark.parametrize("model", MODELS)
def test_fits_reach_the_reference(problem, model):
    name, bounds = MODELS[model]
    expression = CATALOGUE[name].expression
    near = fit_cells(expression, problem.sample, problem.metric, bounds, THOROUGH)
    found = refit_cells(expression, problem.full, problem.metric, bounds, near.columns, THOROUGH, evaluations=30)
    errors = exact_errors(expression, problem, found).by_metric["light"]
    reference = {
        (row["material"], row["channel"]): float(row["error"]) for row in published() if row["model"] == model
    }
    for (material, channel), error in zip(problem.targets, errors, strict=True):
        assert error <= 1.01 * reference[material, channel[0]], (material, channel)
