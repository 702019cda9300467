"""Small problems: a few thousand lit cells, materials made from formulas."""

import numpy as np
import pytest

from fitters.expressions import evaluate
from fitters.expressions.catalogue import CATALOGUE
from fitters.grid import CELLS, SHAPE, above_horizon, cell_directions
from fitters.materials.material import from_samples
from fitters.scenes import LightTable

LIT = 3000
TRUTH = {"p0": 0.05, "p1": 0.8, "p2": 0.25, "p3": 0.3}


@pytest.fixture(scope="session")
def light():
    """Light in 3000 cells, mostly near the normal as a scene's is, of very different strength."""
    rng = np.random.default_rng(0)
    above = np.flatnonzero(above_horizon().ravel())
    table = np.zeros((3, CELLS), np.float32)
    chosen = rng.choice(above, LIT, replace=False)
    table[:, chosen] = 10 ** rng.uniform(-3, 0, (3, LIT))
    table = table.reshape(3, *SHAPE)
    return LightTable(table, (table > 0).any(axis=0), "l" * 32)


@pytest.fixture(scope="session")
def make_material(light):
    """A material of three channels from values at the lit cells: a number, or a function of w_i, w_o (n, 3)."""

    def make(name, *channels):
        samples = np.zeros((3, CELLS))
        lit = light.lit.ravel()
        w_i, w_o = (w[lit] for w in cell_directions())
        for channel, values in enumerate(channels):
            samples[channel, lit] = values(w_i, w_o) if callable(values) else values
        return from_samples(name, samples.reshape(3, *SHAPE), source="test", sha256=name)

    return make


def ggx(**changes):
    return lambda w_i, w_o: evaluate(CATALOGUE["ggx"].expression, TRUTH | changes, w_i, w_o)


@pytest.fixture(scope="session")
def shiny(make_material):
    """GGX of three roughnesses: alpha 0.25, 0.1, 0.6."""
    return make_material("shiny", ggx(), ggx(p2=0.1, p1=0.3), ggx(p2=0.6))
