"""The example of the genBRDF paper's section 3.1: from Phong to a measured Blinn-Phong with n = 80."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy

from fitters import grid
from fitters.backends.sympy_form import to_sympy
from fitters.expressions import parse
from fitters.materials.merl import write_merl
from tests.gpsearch.small import Watching, run_search, small

PHONG = "pow(max(dot(wr, wo), 0), p0)"
N = 80


class Found(Exception):
    """The search may stop."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with blinn.binary, (N.H)^80 in all three channels."""
    folder = tmp_path_factory.mktemp("blinn")
    w_i, w_o = grid.cell_directions()
    half = w_i + w_o
    cosine = half[:, 2] / np.linalg.norm(half, axis=1)
    valid = grid.above_horizon()
    table = np.where(valid.ravel(), cosine**N, 0.0).reshape(grid.SHAPE)
    write_merl(folder / "blinn.binary", np.stack([table] * 3), valid)
    return folder


@pytest.mark.parametrize("seed", [1, 6, 8])
def test_blinn_phong_is_found_from_phong(folder, tmp_path, seed):
    configuration = small(
        folder,
        seed=seed,
        materials=["blinn.binary"],
        scene={"resolution": 32, "light_rows": 16},
        budget={"generations": 40},
        search={
            "start": [PHONG],
            "codebank": [PHONG],
            "islands": 2,
            "island_size": 32,
            "parameters": 1,
            "max_nodes": 20,
            "migrate_every": 5,
        },
        fit={"cells": 512, "confirm_cells": 2048},
        baselines=[],
    )

    found = []

    def stop_when_found(event: str) -> None:
        if event.startswith("stored"):
            found.extend(
                m for m in watcher.statuses[-1].front.members if m.error < 1e-4 and is_power(m.expression)
            )
        if found:
            raise Found

    watcher = Watching(stop_when_found)
    with pytest.raises(Found):
        run_search(tmp_path / "run", configuration, watcher)
    np.testing.assert_allclose(found[0].fit.values, N, rtol=1e-5)


@cache
def is_power(expression: str) -> bool:
    """Whether SymPy can show that an expression is (N.H)^p0.

    The first that fits may be one with a term that never matters, which SymPy cannot know; smaller ones follow it.
    It is told that neither a cosine nor its power exceeds 1, so that a minimum with 1 says nothing.
    """
    cosine, n = sympy.Symbol("N.H", positive=True), sympy.Symbol("p0", real=True)
    form = to_sympy(parse(expression)).subs(sympy.Symbol("wh.z", real=True), cosine)
    form = form.subs({sympy.Min(1, cosine): cosine, sympy.Min(1, cosine**n): cosine**n})
    return bool(sympy.simplify(form - cosine**n) == 0)
