"""The problem that benchmarks fit: four materials under one light, measured ones where there are files."""

from pathlib import Path

import numpy as np

from fitters.fitting import ProblemRecipe
from fitters.fitting.cells import COARSE, Cells
from fitters.scenes import Scene
from tests.shared_data import SHARED

SEED = 1

BUILT_IN = tuple(f"builtin:{name}" for name in ("metal", "glossy-plastic", "rough-plastic", "fabric"))
MEASURED = tuple(
    f"rgl/{name}_rgb.bsdf" for name in ("aurora_white", "satin_purple", "cm_toxic_green", "colodur_napoli_4f")
)
PROBE = "envmaps/grace_probe_latlong.hdr"


def data_folder() -> Path | None:
    """The folder with measured data beside the checkout; None where there is none."""
    folder = SHARED / "data"
    return folder if folder.is_dir() else None


def recipe(data: Path | None) -> ProblemRecipe:
    """RGL's measurements under Grace Cathedral from a folder of data, else built-in materials in the studio."""
    return ProblemRecipe(
        materials=MEASURED if data else BUILT_IN,
        scene=Scene(light=PROBE if data else "studio"),
        metric="light",
        cells=2048,
        confirm_cells=16384,
        seed=SEED,
        folder=str(data or Path.cwd()),
    )


def draw(cells: Cells, count: int) -> Cells:
    """`count` cells, all with the same chance; where there are fewer, all of them again and again."""
    n, coarse = len(cells), count // COARSE
    chosen = np.resize(np.random.default_rng(SEED).permutation(n), count)
    return cells.take(chosen, np.ones(count, int), np.full(count, n / count), np.full(coarse, n / coarse))
