"""Sets of materials made from a formula, so that what they share is known."""

import numpy as np
import pytest

from fitters.expressions import evaluate, parse
from fitters.fitting import FitSettings, Problem, fit_cells
from fitters.fitting.polish import polish
from fitters.grid import CELLS, SHAPE, above_horizon, cell_directions
from fitters.materials.material import from_samples
from fitters.scenes import LightTable

LOBE = parse("p0 / pi + p1 * exp((wh.z - 1) / p2)")
"""Diffuse colour, strength of a lobe, width of it: the first two are linear."""
BOUNDS = {"p0": (1e-6, 1e5), "p1": (1e-6, 1e5), "p2": (1e-6, 1e5)}
LIT = 900


@pytest.fixture(scope="session")
def light():
    rng = np.random.default_rng(3)
    table = np.zeros((3, CELLS), np.float32)
    chosen = rng.choice(np.flatnonzero(above_horizon().ravel()), LIT, replace=False)
    table[:, chosen] = 10 ** rng.uniform(-1, 0, (3, LIT))
    table = table.reshape(3, *SHAPE)
    return LightTable(table, table[0] > 0, "shared")


@pytest.fixture(scope="session")
def lobes(light):
    """The problem of materials, each of three (p0, p1, p2), and its polished free fit."""

    def make(*materials, noise=0.0):
        rng = np.random.default_rng(1)
        lit = light.lit.ravel()
        w_i, w_o = (w[lit] for w in cell_directions())
        made = []
        for number, channels in enumerate(materials):
            samples = np.zeros((3, CELLS))
            for channel, values in enumerate(channels):
                of_names = dict(zip(("p0", "p1", "p2"), values, strict=True))
                samples[channel, lit] = evaluate(LOBE, of_names, w_i, w_o) * np.exp(noise * rng.normal(size=LIT))
            samples = samples.reshape(3, *SHAPE)
            made.append(from_samples(f"m{number}", samples, source="test", sha256=f"{materials} {noise} {number}"))
        problem = Problem(made, light, metric="light", cells=300, confirm_cells=600, seed=4)
        found = fit_cells(LOBE, problem.sample, problem.metric, BOUNDS, FitSettings())
        return problem, polish(LOBE, problem.full, problem.metric, BOUNDS, found)

    return make
