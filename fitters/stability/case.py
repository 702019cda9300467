"""Cases and hazards: a measurement with one defect, the light it is fitted under, and the truth."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from fitters import cache
from fitters.expressions import evaluate
from fitters.expressions.catalogue import formula
from fitters.grid import CELLS, SHAPE, Array, above_horizon, cell_directions
from fitters.materials import Material
from fitters.materials.material import RGB, from_samples
from fitters.materials.outliers import without_outliers
from fitters.scenes import EnvironmentMap, LightTable, load_light
from fitters.scenes.sphere import sphere_light

AZIMUTH_STEP = 8
"""Only every eighth azimuth is lit, so that a trial takes a second: about a hundred thousand lit cells."""

ALPHA = 0.2
R0: RGB = (0.91, 0.60, 0.42)

Known = Mapping[str, Mapping[str, float]]
"""By formula, the parameters that a fit of it should find, the same in every channel."""


@dataclass(frozen=True, eq=False)
class Base:
    """The undisturbed material; `known` is empty for a measurement."""

    material: Material
    known: Known = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Case:
    """A method fits `measured`; it is judged against `truth` in every cell that `light` reaches."""

    truth: Material
    measured: Material
    light: LightTable
    known: Known = field(default_factory=dict)


@dataclass(frozen=True)
class Hazard:
    """Something that is known to make fits fail: `make(base, level, seed)` is a case of it.

    levels:     names of the severity, from mild to hard; `level` is an index of them
    random:     whether the seed changes the case
    any_base:   whether it can be made from any material, or needs a formula of its own
    """

    name: str
    meaning: str
    levels: tuple[str, ...]
    make: Callable[[Base, int, int], Case]
    random: bool = False
    any_base: bool = True


@lru_cache(maxsize=1)
def metal() -> Base:
    """A coloured GGX (Walter et al. 2007) without a diffuse part, which every method fits best."""
    samples = formula_samples("ggx", *({"p0": 0.0, "p1": 1.0, "p2": ALPHA, "p3": r0} for r0 in R0))
    return Base(material("ggx metal", samples), {"ggx": {"p2": ALPHA}})


def undisturbed(base: Base, light: LightTable | None = None) -> Case:
    """The base as it is."""
    return Case(base.material, base.material, light or studio(), base.known)


@lru_cache(maxsize=1)
def studio() -> LightTable:
    """The light of all hazards that have none of their own."""
    return thinned_light(load_light("studio"))


def thinned_light(light: EnvironmentMap) -> LightTable:
    """The light table of the sphere under a map, of every `AZIMUTH_STEP`-th azimuth."""
    table = sphere_light(light).astype(np.float32)
    table[..., np.arange(SHAPE[2]) % AZIMUTH_STEP != 0] = 0.0
    return LightTable(
        table, np.any(table > 0, axis=0), cache.digest("thinned light", AZIMUTH_STEP, light.radiance)
    )


def formula_samples(name: str, *channels: Mapping[str, float]) -> Array:
    """A catalogue formula, parameters for each channel, as samples (3, 90, 90, 180), NaN below the horizon."""
    expression, above = formula(name).expression, above_horizon().ravel()
    w_i, w_o = (w[above] for w in cell_directions())
    samples = np.full((3, CELLS), np.nan, np.float32)
    for channel, parameters in enumerate(channels):
        samples[channel, above] = evaluate(expression, parameters, w_i, w_o)
    return samples.reshape(3, *SHAPE)


def samples_of(of: Material) -> Array:
    """The table (3, 90, 90, 180) as raw samples, NaN in cells that are not valid."""
    return np.where(of.valid, of.table, np.float32(np.nan))


def material(name: str, samples: Array) -> Material:
    """A material of raw samples, treated as those of a file; its hash is that of its name and samples."""
    read = from_samples(name, samples, source="synthetic", sha256=cache.digest(name, samples))
    return without_outliers(read)


def disturbed(base: Base, name: str, samples: Array) -> Case:
    """A case whose samples were made from the base, which is the truth."""
    return Case(base.material, material(name, samples), studio(), base.known)


def other_truth(name: str, samples: Array, known: Known | None = None, light: LightTable | None = None) -> Case:
    """A case whose material is measured without a defect, but hard to fit."""
    made = material(name, samples)
    return Case(made, made, light or studio(), known or {})
