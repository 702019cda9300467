"""A problem: materials under a scene, by a metric, as arrays over cells, whole and as small weighted samples.

Cells that the scene does not light, or where no material is valid, are left out from the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fitters import cache
from fitters.engine.warm import warm_up
from fitters.errors import FittersError
from fitters.expressions.evaluation import features
from fitters.fitting.cells import Cells, sample
from fitters.fitting.settings import CELLS, CONFIRM_CELLS
from fitters.grid import CHANNELS, Array, cell_directions
from fitters.judging.metrics import COSINE, RESIDUALS, Residual
from fitters.materials import AnisotropicMaterial, Material, is_anisotropic, load_anisotropic, load_material
from fitters.scenes import LightTable, Scene, light_table

ORDINARY = (1e-4, 1e4)
"""Levels of a measurement, sr^-1, for which bounds of parameters are meant. Others are in other units: there the
bounds of what a formula is linear in count in these, so that its fit does not depend on the units."""

Measurement = Material | AnisotropicMaterial

STUDIO = Scene()
"""A sphere under the built-in light `studio`."""


class Problem:
    """Materials under a scene, by a metric: what a model is fitted to.

        problem = Problem([load_material("steel.binary")], Scene("grace.hdr"), metric="light")

    materials:     loaded ones, or what names them: `"steel.binary"`, `"builtin:metal"`; their names differ
    scene:         a `Scene`, or the light table of one
    metric:        the name of one of `RESIDUALS`
    cells:         that the small sample is drawn from all lit ones with, and `confirm_cells` the large one
    seed:          of both samples
    base:          the folder that relative paths count from, by default the working directory

    Files are read and arrays computed when they are first needed. There is a target for each material and colour
    channel, material by material. Anisotropic measurements make a problem of their own, without a scene, whose
    metric is `cosine`; only some models take them.

    Raises `FittersError` for a metric that there is none of, two materials of one name, a bad file, or a scene
    that lights no cell of a material.
    """

    def __init__(
        self,
        materials: Sequence[Measurement | str | Path],
        scene: Scene | LightTable = STUDIO,
        *,
        metric: str = "light",
        cells: int = CELLS,
        confirm_cells: int = CONFIRM_CELLS,
        seed: int = 0,
        base: Path | None = None,
    ) -> None:
        if metric not in RESIDUALS:
            raise FittersError(f"no metric {metric!r}: there are {', '.join(RESIDUALS)}")
        self.scene = scene
        self._given, self._metric, self._base = tuple(materials), metric, base
        self._cells, self._confirm_cells, self._seed = cells, confirm_cells, seed
        if all(isinstance(given, Measurement) for given in self._given):
            _ = self.measurements

    def __repr__(self) -> str:
        given = ", ".join(each.name if isinstance(each, Measurement) else str(each) for each in self._given)
        return f"Problem([{given}], {self.scene!r}, metric={self._metric!r})"

    @cached_property
    def measurements(self) -> tuple[Measurement, ...]:
        """The materials, loaded, of either kind."""
        loaded = tuple(_loaded(given, self._base) for given in self._given)
        names = {material.name for material in loaded}
        if not names or len(names) < len(loaded):
            raise FittersError(f"materials: {len(loaded)} given, {len(names)} different names; name each once")
        if len({type(material) for material in loaded}) > 1:
            raise FittersError(
                "anisotropic .bin files are judged over their own samples, other materials in a light: fit them "
                "in two commands, or two problems"
            )
        return loaded

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """The materials, loaded. Raises `FittersError` where they are anisotropic."""
        isotropic = tuple(material for material in self.measurements if isinstance(material, Material))
        if not isotropic:
            raise FittersError(f"{self.names[0]} is anisotropic: the grid of isotropic materials does not hold it")
        return isotropic

    @property
    def anisotropic(self) -> bool:
        return isinstance(self.measurements[0], AnisotropicMaterial)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the materials."""
        return tuple(material.name for material in self.measurements)

    @property
    def targets(self) -> tuple[tuple[str, str], ...]:
        """(material, channel) of every target."""
        return tuple((material, channel) for material in self.names for channel in CHANNELS)

    @property
    def metric(self) -> Residual:
        return COSINE if self.anisotropic else RESIDUALS[self._metric]

    @property
    def metrics(self) -> dict[str, Residual]:
        """All that models can be judged by on this problem."""
        return {COSINE.name: COSINE} if self.anisotropic else dict(RESIDUALS)

    @property
    def scene_name(self) -> str:
        """What a message calls the scene."""
        return self.scene.light if isinstance(self.scene, Scene) else "the light"

    @cached_property
    def light(self) -> LightTable:
        """The light table of the scene."""
        return self.scene if isinstance(self.scene, LightTable) else light_table(self.scene, base=self._base)

    @cached_property
    def index(self) -> NDArray[np.int64]:
        """(n,) flat indices of the cells that the scene lights and some material was measured in."""
        light, materials = self.light, self.materials
        valid = np.any([material.valid for material in materials], axis=0)
        index = np.flatnonzero((light.lit & valid).ravel())
        if not len(index):
            raise FittersError("the scene lights no cell in which a material was measured: choose another light")
        for material in materials:
            if not np.any(material.valid.ravel()[index]):
                raise FittersError(f"{material.name}: the scene lights none of its cells; choose another light")
        return index

    @cached_property
    def full(self) -> Cells:
        """All cells that matter, weighted for the metric."""
        return full_cells(self, self.metric)

    @cached_property
    def fine(self) -> Cells:
        """The large weighted sample of them."""
        return sample(self.full, self._confirm_cells, self._seed)

    @cached_property
    def sample(self) -> Cells:
        """The small weighted sample of them."""
        return sample(self.full, self._cells, self._seed)

    @cached_property
    def sha256(self) -> str:
        """Identifies the problem: equal problems have equal fits."""
        return cache.digest(
            self._metric,
            self._cells,
            self._confirm_cells,
            self._seed,
            self.light.sha256,
            *(material.sha256 for material in self.materials),
        )

    def ready(self) -> "Problem":
        """The problem itself, with all arrays computed and the engine compiled: times of fits count neither."""
        warm_up()
        _ = self.full, self.fine, self.sample
        return self

    def of_material(self, material: int) -> "Problem":
        """The same problem for one of its materials alone, on the same cells."""
        rows = slice(len(CHANNELS) * material, len(CHANNELS) * (material + 1))
        one = Problem(
            (self.materials[material],),
            self.light,
            metric=self._metric,
            cells=self._cells,
            confirm_cells=self._confirm_cells,
            seed=self._seed,
            base=self._base,
        )
        vars(one).update(
            index=self.index,
            full=self.full.targets_only(rows),
            fine=self.fine.targets_only(rows),
            sample=self.sample.targets_only(rows),
            sha256=cache.digest("of material", self.sha256, material),
        )
        return one


@dataclass(frozen=True)
class ProblemRecipe:
    """The few hundred bytes from which every process builds the same problem, with the names of `Problem`.

    Materials and light are references, relative to `folder`.
    """

    materials: tuple[str, ...]
    scene: Scene
    metric: str
    cells: int
    confirm_cells: int
    seed: int
    folder: str

    def of(self, material: str) -> "ProblemRecipe":
        """The same for another material alone."""
        return replace(self, materials=(material,))

    def build(self) -> Problem:
        """The problem, ready. Raises `FittersError` for a file that is missing or bad."""
        return Problem(
            self.materials,
            self.scene,
            metric=self.metric,
            cells=self.cells,
            confirm_cells=self.confirm_cells,
            seed=self.seed,
            base=Path(self.folder),
        ).ready()


def _loaded(
    given: Material | AnisotropicMaterial | str | Path, base: Path | None
) -> Material | AnisotropicMaterial:
    if isinstance(given, Material | AnisotropicMaterial):
        return given
    return load_anisotropic(given, base=base) if is_anisotropic(given) else load_material(given, base=base)


def full_cells(problem: Problem, metric: Residual) -> Cells:
    """All cells of a problem, weighted for a metric."""
    count = len(problem.targets)
    weights = np.empty((count, len(problem.index)), np.float32)
    targets = np.empty_like(weights)
    for target in range(count):
        weights[target], targets[target] = weighted_target(problem, metric, target)
    w_i, w_o = cell_directions()
    seen = features(w_i[problem.index], w_o[problem.index])
    return Cells(problem.index, seen, weights, targets, units=_units(problem))


def _units(problem: Problem) -> Array | None:
    """Per target a power of ten near its level, the mean of m under T, where that is no reflectance in sr^-1."""
    levels = np.ones(len(problem.targets))
    for target in range(len(levels)):
        material, channel = problem.materials[target // len(CHANNELS)], target % len(CHANNELS)
        light = problem.light.table[channel].ravel()[problem.index].astype(np.float64)
        measured = light * material.table[channel].ravel()[problem.index]
        if light.any() and measured.any():
            levels[target] = np.sum(measured) / np.sum(light)
    units = np.where((levels >= ORDINARY[0]) & (levels <= ORDINARY[1]), 1.0, 10.0 ** np.round(np.log10(levels)))
    return None if np.all(units == 1.0) else units


def weighted_target(problem: Problem, metric: Residual, target: int) -> tuple[Array, Array]:
    """Weights (n,) of one target over all cells, 0 where it is not valid, and weights times measured values."""
    material, channel = problem.materials[target // len(CHANNELS)], target % len(CHANNELS)
    valid = material.valid.ravel()[problem.index]
    at = problem.index[valid]
    light = problem.light.table[channel].ravel()[at].astype(np.float64)
    measured = material.table[channel].ravel()[at].astype(np.float64)
    weights, targets = np.zeros(len(problem.index)), np.zeros(len(problem.index))
    weights[valid], targets[valid] = metric.weighted(light, measured)
    return weights, targets
