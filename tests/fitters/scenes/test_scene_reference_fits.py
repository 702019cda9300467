"""The scene's geometry against errors that an independent program published for its own light table."""

import numpy as np
import pytest

from fitters.grid import above_horizon, cell_directions
from tests.reference_scene import needs_shared_data, published, reference_table, surrogates

MATERIALS = ("steel", "pvc", "green-acrylic")

pytestmark = needs_shared_data


def ggx(w_i, w_o, alpha, r0, kd, ks):
    """kd + ks F D G / (4 nl nv): Schlick F(V.H), height-correlated Smith, as the reference states it."""
    half = (w_i + w_o) / np.linalg.norm(w_i + w_o, axis=-1, keepdims=True)
    squared, nl, nv = alpha**2, w_i[:, 2], w_o[:, 2]
    ndf = squared / (np.pi * (half[:, 2] ** 2 * (squared - 1) + 1) ** 2)
    fresnel = r0 + (1 - r0) * (1 - np.sum(w_o * half, axis=-1)) ** 5
    lambdas = [(np.sqrt(1 + squared * (1 - c**2) / c**2) - 1) / 2 for c in (nl, nv)]
    return kd + ks * fresnel * ndf / (1 + lambdas[0] + lambdas[1]) / (4 * nl * nv)


def test_published_parameters_give_the_published_errors():
    table = reference_table()
    cells = above_horizon().ravel() & (table > 0).any(axis=0)
    w_i, w_o = (w[cells] for w in cell_directions())
    measured = surrogates(MATERIALS)
    rows = [row for row in published() if row["model"] == "ggx" and row["material"] in MATERIALS]
    assert len(rows) == 3 * len(MATERIALS)
    for row in rows:
        channel = "rgb".index(row["channel"])
        light, target = table[channel, cells], measured[row["material"]][channel, cells]
        difference = ggx(w_i, w_o, *(float(row[f"p{i}"]) for i in (1, 2, 3, 4))) - target
        error = np.linalg.norm(light * difference) / np.linalg.norm(light * target)
        assert error == pytest.approx(float(row["error"]), rel=1e-5)
