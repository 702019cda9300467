"""The materials that baselines are measured on: RGL measurements, MERL surrogates, or built-in ones."""

import importlib.util
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fitters.materials import Material, load_material
from fitters.materials.material import from_samples
from fitters.models.factors.tables import MicrofacetFactors
from tests.benchmarks.problem import BUILT_IN


@dataclass(frozen=True)
class MaterialSet:
    """A set under the name that its figures are reported with; `names` may be cut to the first few."""

    title: str
    names: tuple[str, ...]
    folder: Path | None

    def materials(self) -> Iterator[Material]:
        for name in self.names:
            yield self._load(name)

    def _load(self, name: str) -> Material:
        if self.folder is None:
            return load_material(name)
        if self.folder.name == "rgl":
            return load_material(self.folder / f"{name}.bsdf")
        tool, networks = _surrogates(self.folder)
        names = [str(n) for n in networks["names"]]
        return from_samples(name, tool.table(networks, names.index(name)), source="MERL surrogate", sha256=name)


def material_sets(data: Path | None) -> list[MaterialSet]:
    """What a folder of data holds; the built-in materials without one."""
    if data is None:
        return [MaterialSet("built-in materials", BUILT_IN, None)]
    measured = tuple(sorted(path.stem for path in (data / "rgl").glob("*.bsdf")))
    sets = [MaterialSet("RGL measurements", measured, data / "rgl")]
    if (data / "merl" / "nbrdf.npz").exists():
        with np.load(data / "merl" / "nbrdf.npz") as networks:
            names = tuple(str(n) for n in networks["names"])
        sets.append(MaterialSet("MERL surrogates", names, data / "merl"))
    return sets


def authors_factors(data: Path | None, material: str) -> MicrofacetFactors | None:
    """The tables that Bagher et al. 2016 fitted to the measurement behind a surrogate (they hold pi times it)."""
    path = data / "merl" / "npf.npz" if data else None
    if path is None or not path.exists():
        return None
    tables = _npz(path)
    names = [str(n) for n in tables["names"]]
    if material not in names:
        return None
    k = names.index(material)
    arrays = {key: tables[key][k].astype(np.float64) for key in ("rho_d", "rho_s", "D", "F", "G")}
    return MicrofacetFactors(**(arrays | {key: arrays[key] / np.pi for key in ("rho_d", "rho_s")}))


@cache
def _npz(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as stored:
        return {name: stored[name] for name in stored.files}


@cache
def _surrogates(folder: Path) -> tuple[Any, dict[str, np.ndarray]]:
    """The program that expands surrogates, which lies beside the data, and what it expands."""
    spec = importlib.util.spec_from_file_location(
        "merl_surrogate", folder.parents[1] / "tools" / "merl_surrogate.py"
    )
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    return tool, _npz(folder / "nbrdf.npz")
