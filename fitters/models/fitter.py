"""How a model is fitted: what the registry holds of every model, whatever its kind.

A `Fitter` answers every question about its model, so that no caller asks which kind it is. Formulas are fitted to
all materials of a problem together (`fitters.models.formula`), everything else to each material alone
(`MaterialFitter`).
"""

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, ClassVar

import numpy as np
from threadpoolctl import threadpool_limits

from fitters import cache, materials
from fitters.errors import FittersError
from fitters.fitting.exact import model_errors
from fitters.fitting.problem import Measurement, Problem
from fitters.fitting.settings import FitSettings
from fitters.fitting.stages import Description
from fitters.judging.metrics import RESIDUALS
from fitters.materials import Material
from fitters.materials.synthetic import matte
from fitters.models.fitted import Fitted, MaterialFit, PerChannel, arrays_of, model_of
from fitters.models.model import Model


@dataclass(frozen=True)
class Family:
    """Models of one sort: how charts name them, and their colour there."""

    name: str
    label: str
    colour: str


@dataclass(frozen=True)
class FitStage:
    """A step of a fit whose tasks may run anywhere: `function(problem, task)` for each.

    Stages of one `label` cost about the same, `seconds` a task at first guess.
    """

    function: Callable[[Problem, Any], Any]
    tasks: tuple[Any, ...]
    label: str
    seconds: float


@dataclass(frozen=True)
class FormulaBaseline:
    """A published formula fitted to all targets of a problem, and how long that took."""

    description: Description
    fit_seconds: float

    @property
    def metrics(self) -> dict[str, float]:
        """The error over all targets by every metric."""
        return self.description.metrics


@dataclass(frozen=True)
class TabulatedBaseline:
    """A model that is no formula, fitted to every material of a problem; its tables are not kept here.

    kind:        the name of its family
    errors:      (targets,) by metric, infinite for a material that it could not be fitted to
    floats:      numbers stored per material
    fit_seconds: of all materials
    cost_ns:     per evaluation, the median of the materials; it and `floats` are 0 where no fit succeeded
    warnings:    each begins with a material's name; why a fit failed comes first
    """

    kind: str
    errors: dict[str, tuple[float, ...]]
    floats: int
    fit_seconds: float
    cost_ns: float
    warnings: tuple[str, ...]

    @property
    def metrics(self) -> dict[str, float]:
        """The error over all targets by every metric."""
        return {name: RESIDUALS[name].combine(np.array(errors)) for name, errors in self.errors.items()}


Baseline = FormulaBaseline | TabulatedBaseline
Stages = Generator[FitStage, Sequence[Any], Baseline]
"""Yields stages, is sent the results of their tasks in order, and returns the baseline."""


@dataclass(frozen=True)
class FitSummary:
    """A model fitted to one material, without its tables: errors per channel by metric, size, seconds, cost.

    Where it could not be fitted, the errors are infinite, size and cost are 0, and a warning says why. Every
    warning begins with the material's name.
    """

    errors: dict[str, PerChannel]
    floats: int
    fit_seconds: float
    cost_ns: float
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class MaterialTask:
    """A model by its name in the registry, and which of a problem's materials it is fitted to."""

    model: str
    material: int


class Fitter(ABC):
    """A model that can be fitted: an entry of `MODELS`.

    name:              by which it is asked for
    family:            what sort of model it is
    model:             the class of what it makes of a material
    baseline:          whether a run may name it among its baselines
    takes_anisotropic: whether it also takes anisotropic measurements
    together:          whether one fit is about all materials of a problem
    solvers:           ways of fitting it, the default first, where there are several
    """

    name: str
    family: Family
    model: type[Model]
    baseline: bool = True
    takes_anisotropic: bool = False
    solvers: tuple[str, ...] = ()
    together: ClassVar[bool] = False

    @property
    def options(self) -> tuple[str, ...]:
        """What `fit` takes by name besides the problem."""
        return ()

    def fit(self, problem: Problem, **options: Any) -> Fitted:
        """The model fitted to a problem. Raises `FittersError` where it cannot be, or for an unknown option."""
        for option in options:
            if option not in self.options:
                raise FittersError(
                    f"{self.name} takes no {option}: "
                    + (f"it takes {', '.join(self.options)}" if self.options else "there is one way of fitting it")
                )
        if problem.anisotropic and not self.takes_anisotropic:
            raise FittersError(f"{self.name} takes isotropic materials: {_takers()} takes .bin files")
        return self._fit(problem, **options)

    @abstractmethod
    def _fit(self, problem: Problem, **options: Any) -> Fitted: ...

    @abstractmethod
    def stages(self, materials: int, settings: FitSettings) -> Stages:
        """The fit to a problem of this many materials as stages, for a search that keeps it as a baseline."""

    @abstractmethod
    def count_tasks(self, materials: int) -> int:
        """How many tasks all `stages` have."""

    def warm_up(self) -> None:  # noqa: B027
        """Compiles what a fit needs besides the engine, or loads it from the disk cache."""


@dataclass(frozen=True, eq=False)
class MaterialFitter(Fitter):
    """A model that is fitted to each material alone, whatever the scene; the scene is where it is judged.

    fit_material: to a material, and with `solver` by name where there are `solvers`
    quick:        a shorter fit for `warm_up`, where there is one
    packages:     whose code the fit depends on, besides that of materials
    """

    name: str
    family: Family
    model: type[Model]
    fit_material: Callable[..., MaterialFit]
    packages: tuple[Any, ...]
    solvers: tuple[str, ...] = ()
    takes_anisotropic: bool = False
    baseline: bool = True
    quick: Callable[[Material], MaterialFit] | None = None

    @property
    def options(self) -> tuple[str, ...]:
        return ("solver",) if self.solvers else ()

    def of_material(self, material: Measurement, *, solver: str | None = None) -> MaterialFit:
        """The model of one material. Raises `FittersError` where it cannot be fitted, or for an unknown solver."""
        given = {}
        if solver is not None:
            if solver not in self.solvers:
                known = (
                    f"there are {', '.join(self.solvers)}" if self.solvers else "it has one way of being fitted"
                )
                raise FittersError(f"{self.name} has no solver {solver!r}: {known}")
            given = {"solver": solver}
        # With more threads, BLAS adds up in another order, and the same fit ends in other last bits.
        with threadpool_limits(1, "blas"):
            fit = self.fit_material(material, **given)
        doubts = material.doubts if isinstance(material, Material) else ()
        return replace(fit, warnings=(*doubts, *fit.warnings))

    def kept(self, material: Material) -> MaterialFit:
        """The model of one material, without its details, fitted once on a machine and kept on disk.

        Kept by the material's samples and the code that fits. Raises `FittersError` as `of_material` does.
        """

        def build() -> dict[str, np.ndarray]:
            fit = self.of_material(material)
            return {
                "warnings": np.array(fit.warnings, np.str_),
                **{f"model.{name}": values for name, values in arrays_of(fit.model).items()},
            }

        code = cache.of_code(*(Path(package.__path__[0]) for package in (materials, *self.packages)))
        key = cache.digest(self.name, material.name, material.table, material.valid, material.doubts, code)
        stored = cache.arrays("baseline", key, build)
        arrays = {name.removeprefix("model."): v for name, v in stored.items() if name.startswith("model.")}
        return MaterialFit(model_of(arrays, {self.model.kind: self.model}), tuple(map(str, stored["warnings"])))

    def _fit(self, problem: Problem, **options: Any) -> Fitted:
        fits = {material.name: self.of_material(material, **options) for material in problem.measurements}
        by_metric = [model_errors(problem, number, fit.model) for number, fit in enumerate(fits.values())]
        several = len(fits) > 1
        return Fitted(
            name=self.name,
            fits=fits,
            metric=problem.metric.name,
            errors={name: errors[problem.metric.name] for name, errors in zip(fits, by_metric, strict=True)},
            metrics={
                name: metric.combine(np.array([errors[name] for errors in by_metric]).ravel())
                for name, metric in problem.metrics.items()
            },
            fit_seconds=sum(fit.model.fit_seconds for fit in fits.values()),
            warnings=tuple(
                f"{name}: {warning}" if several else warning
                for name, fit in fits.items()
                for warning in fit.warnings
            ),
        )

    def summarise(self, problem: Problem, material: int) -> FitSummary:
        """The kept model of one of a problem's materials, judged on the problem; never an exception."""
        measured = problem.materials[material]
        began = time.perf_counter()
        try:
            fit = self.kept(measured)
        except FittersError as error:
            # Data, not an exception: what one material lacks must not end a run over many.
            infinite = dict.fromkeys(RESIDUALS, (math.inf, math.inf, math.inf))
            seconds = time.perf_counter() - began
            return FitSummary(infinite, 0, seconds, 0.0, (_about(measured.name, str(error)),))
        model = fit.model
        errors = model_errors(problem, material, model)
        warnings = tuple(_about(measured.name, warning) for warning in fit.warnings)
        return FitSummary(errors, model.floats, model.fit_seconds, model.cost_ns(), warnings)

    def stages(self, materials: int, settings: FitSettings) -> Stages:
        from fitters.models.registry import summarise

        tasks = tuple(MaterialTask(self.name, material) for material in range(materials))
        # The tasks of every model have a cost of their own, which its name begins with.
        summaries = yield FitStage(summarise, tasks, f"{self.name} baseline", 10.0)
        return self.joined(summaries)

    def count_tasks(self, materials: int) -> int:
        return materials

    def joined(self, summaries: Sequence[FitSummary]) -> TabulatedBaseline:
        """The baseline that the fits to every material, in their order, make together."""
        failed_first = sorted(summaries, key=lambda one: one.floats > 0)
        return TabulatedBaseline(
            kind=self.family.name,
            errors={m: tuple(e for one in summaries for e in one.errors[m]) for m in summaries[0].errors},
            floats=max(one.floats for one in summaries),
            fit_seconds=sum(one.fit_seconds for one in summaries),
            cost_ns=median([one.cost_ns for one in summaries if one.floats] or [0.0]),
            warnings=tuple(warning for one in failed_first for warning in one.warnings),
        )

    def warm_up(self) -> None:
        up = np.array([[0.0, 0.0, 1.0]])
        (self.quick or self.fit_material)(matte()).model.evaluate(up, up)


def _takers() -> str:
    from fitters.models.registry import MODELS

    return "only " + " and ".join(name for name, fitter in MODELS.items() if fitter.takes_anisotropic)


def _about(material: str, sentence: str) -> str:
    """The sentence with the material's name before it; errors have it already."""
    return sentence if sentence.startswith(f"{material}: ") else f"{material}: {sentence}"
