"""The scene and the materials of the independent program behind `reference_fits` of the shared data.

Its light table makes two choices of its own, repeated here: a source texel goes whole to the texel its index
truncates to, and phi_diff is folded by its absolute value, where `fitters.grid` takes it modulo pi as the
readers of MERL files do.
"""

import csv
import importlib.util
from functools import cache

import numpy as np
import pytest

from fitters.grid import CELLS, cell_index, half_diff
from fitters.scenes import EnvironmentMap, load_light
from fitters.scenes.geometry import sphere
from tests.shared_data import SHARED

GRACE = SHARED / "data/envmaps/grace_probe_latlong.hdr"
FITS = SHARED / "data/reference_fits/light_error.csv"
NETWORKS = SHARED / "data/merl/nbrdf.npz"
TOOL = SHARED / "tools/merl_surrogate.py"

needs_shared_data = pytest.mark.skipif(
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


@cache
def reference_table():
    """The light table (3, CELLS) that the published errors are under."""
    return folded_table(reduced_by_index(load_light(str(GRACE)), 48), sphere(64).normals)


def surrogates(names):
    """Tables (3, CELLS) of the MERL surrogates by name."""
    spec = importlib.util.spec_from_file_location("merl_surrogate", TOOL)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    networks = np.load(NETWORKS)
    known = [str(name) for name in networks["names"]]
    return {name: tool.table(networks, known.index(name)).reshape(3, CELLS) for name in names}


def published():
    """Rows of the published fits, as dictionaries of text."""
    with FITS.open() as file:
        return list(csv.DictReader(file))
