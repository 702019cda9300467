"""The scene's geometry against errors that an independent program published for its own light table.

That program (`reference_fits` of the shared data) makes two choices of its own, which this test repeats: a
source texel goes whole to the texel its index truncates to, and phi_diff is folded by its absolute value,
where `fitters.grid` takes it modulo pi as the readers of MERL files do.
"""

import csv
import importlib.util
from pathlib import Path

import numpy as np
import pytest

from fitters.grid import CELLS, above_horizon, cell_directions, cell_index, half_diff
from fitters.scenes import EnvironmentMap, load_light
from fitters.scenes.kernel import sphere_normals

SHARED = Path(__file__).parents[4] / "shared"
GRACE = SHARED / "data/envmaps/grace_probe_latlong.hdr"
FITS = SHARED / "data/reference_fits/light_error.csv"
NETWORKS = SHARED / "data/merl/nbrdf.npz"
TOOL = SHARED / "tools/merl_surrogate.py"
MATERIALS = ("steel", "pvc", "green-acrylic")

pytestmark = pytest.mark.skipif(
    not all(path.exists() for path in (GRACE, FITS, NETWORKS, TOOL)), reason=f"no shared data in {SHARED}"
)


def reduced_by_index(light, rows):
    at = np.arange(2 * light.rows) * rows // light.rows
    starts = np.searchsorted(at, np.arange(2 * rows))
    weights = np.broadcast_to(light.solid_angles()[..., None], (light.rows, 2 * light.rows, 1))

    def blocks(values):
        return np.add.reduceat(np.add.reduceat(values, starts[:rows], axis=0), starts, axis=1)

    return EnvironmentMap(blocks(light.radiance * weights) / blocks(weights))


def folded_table(light, normals):
    """Light table (3, CELLS) with phi_diff folded by its absolute value."""
    directions = light.directions().reshape(-1, 3)
    emission = (light.radiance * light.solid_angles()[..., None]).reshape(-1, 3)
    halves = directions + np.array([0.0, 0.0, 1.0])
    crossed = np.cross(halves, directions)
    table = np.zeros((3, CELLS))
    for normal in normals:
        tangent = np.cross(normal, [0.3, -0.5, 0.8])
        tangent /= np.linalg.norm(tangent)
        frame = np.stack([tangent, np.cross(normal, tangent), normal])
        above = directions @ normal > 0
        w_i = directions[above] @ frame.T
        theta_half, theta_diff, phi_diff = half_diff(w_i, np.broadcast_to(frame[:, 2], w_i.shape))
        phi_diff = np.where(crossed[above] @ normal < 0, np.pi - phi_diff, phi_diff)
        cells = cell_index(theta_half, theta_diff, np.clip(phi_diff, 0, np.nextafter(np.pi, 0)))
        for c in range(3):
            np.add.at(table[c], cells, emission[above, c] * w_i[:, 2])
    return table / len(normals)


def ggx(w_i, w_o, alpha, r0, kd, ks):
    """kd + ks F D G / (4 nl nv): Schlick F(V.H), height-correlated Smith, as the reference states it."""
    half = (w_i + w_o) / np.linalg.norm(w_i + w_o, axis=-1, keepdims=True)
    squared, nl, nv = alpha**2, w_i[:, 2], w_o[:, 2]
    ndf = squared / (np.pi * (half[:, 2] ** 2 * (squared - 1) + 1) ** 2)
    fresnel = r0 + (1 - r0) * (1 - np.sum(w_o * half, axis=-1)) ** 5
    lambdas = [(np.sqrt(1 + squared * (1 - c**2) / c**2) - 1) / 2 for c in (nl, nv)]
    return kd + ks * fresnel * ndf / (1 + lambdas[0] + lambdas[1]) / (4 * nl * nv)


def surrogates():
    spec = importlib.util.spec_from_file_location("merl_surrogate", TOOL)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    networks = np.load(NETWORKS)
    names = [str(name) for name in networks["names"]]
    return {name: tool.table(networks, names.index(name)).reshape(3, CELLS) for name in MATERIALS}


def test_published_parameters_give_the_published_errors():
    table = folded_table(reduced_by_index(load_light(str(GRACE)), 48), sphere_normals(64))
    cells = above_horizon().ravel() & (table > 0).any(axis=0)
    w_i, w_o = (w[cells] for w in cell_directions())
    measured = surrogates()
    with FITS.open() as file:
        rows = [row for row in csv.DictReader(file) if row["model"] == "ggx" and row["material"] in MATERIALS]
    assert len(rows) == 3 * len(MATERIALS)
    for row in rows:
        channel = "rgb".index(row["channel"])
        light, target = table[channel, cells], measured[row["material"]][channel, cells]
        difference = ggx(w_i, w_o, *(float(row[f"p{i}"]) for i in (1, 2, 3, 4))) - target
        error = np.linalg.norm(light * difference) / np.linalg.norm(light * target)
        assert error == pytest.approx(float(row["error"]), rel=1e-5)
