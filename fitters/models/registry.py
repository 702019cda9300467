"""All models that can be fitted, by name, and the one verb that fits them.

To add a model: a file with a class of `Model` and a tuple `FITTERS` of how it is fitted, and a line in `_MODULES`.
"""

import difflib
import re
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from fitters.engine import warm as engine
from fitters.errors import FittersError
from fitters.expressions import Expression, parse
from fitters.fitting.problem import Problem
from fitters.models.fitted import Fitted, read
from fitters.models.fitter import Family, FitSummary, Fitter, MaterialFitter, MaterialTask
from fitters.models.formula import FormulaFitter
from fitters.models.model import Model

_MODULES = (
    "fitters.models.formula",
    "fitters.models.factors.fitters",
    "fitters.models.power_iterations.fitters",
    "fitters.models.measured",
)

_FITTERS: tuple[Fitter, ...] = tuple(fitter for name in _MODULES for fitter in import_module(name).FITTERS)

MODELS: Mapping[str, Fitter] = {fitter.name: fitter for fitter in _FITTERS}
"""What `fit` takes by name: the published formulas, factor tables, power iterations and the measured table."""

BASELINES: tuple[str, ...] = tuple(name for name, fitter in MODELS.items() if fitter.baseline)
"""Names of the models that a run may have beside its search."""

FAMILIES: Mapping[str, Family] = {fitter.family.name: fitter.family for fitter in _FITTERS}
"""Sorts of models, by name."""

KINDS: Mapping[str, type[Model]] = {fitter.model.kind: fitter.model for fitter in _FITTERS}
"""Classes of models by their kind: what a saved file may hold."""


def fitter_of(model: str | Expression | Fitter) -> Fitter:
    """What fits a model: a name of `MODELS`, an expression or its text, such as `"p0 + p1 * pow(wh.z, p2)"`.

    Raises `FittersError` with the nearest name, or with what is wrong with the text.
    """
    if isinstance(model, Fitter):
        return model
    if isinstance(model, Expression):
        return FormulaFitter.of_expression(model)
    if model in MODELS:
        return MODELS[model]
    try:
        return FormulaFitter.of_expression(parse(model), name=model)
    except FittersError:
        if re.fullmatch(r"[A-Za-z][\w-]*", model):
            near = difflib.get_close_matches(model, MODELS, 1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(MODELS)}"
            raise FittersError(f"no formula or baseline {model!r}: {hint}") from None
        raise


def material_fitter(name: str) -> MaterialFitter:
    """The fitter of a model that is fitted to each material alone. Raises `FittersError` where there is none."""
    fitter = fitter_of(name)
    if not isinstance(fitter, MaterialFitter):
        raise FittersError(f"{name} is fitted to all materials of a problem together, not to one alone")
    return fitter


def fit(model: str | Expression | Fitter, problem: Problem, **options: Any) -> Fitted:
    """A model fitted to the materials of a problem.

        fitted = fit("ggx", Problem(["builtin:metal"]))

    model:   a name of `MODELS`, an expression, or the text of one. Expressions are fitted to all materials
             together, everything else to each material alone
    options: of formulas `settings`, how hard the fit tries, and `bounds`, by parameter or one (low, high) for all;
             of factor tables `solver`, "joint" or "awls"

    Deterministic: the same model and problem give the same bits on the same kind of processor. Raises
    `FittersError` for an unknown model or option, and where a model cannot be fitted to a material.
    """
    return fitter_of(model).fit(problem, **options)


def load(path: str | Path) -> Fitted:
    """What `Fitted.save` wrote. Raises `FittersError` for any other file."""
    return read(Path(path), KINDS)


def warm_up(names: Iterable[str] = ()) -> None:
    """Compiles what every fit needs and what those of these models need, or loads it from the disk cache.

    Half a minute on a new machine, once. Several processes that begin to fit at once would all compile the same.
    """
    engine.warm_up()
    for name in names:
        MODELS[name].warm_up()


def summarise(problem: Problem, task: MaterialTask) -> FitSummary:
    """The fit of a task, judged on the problem: what a worker does of a baseline that is no formula."""
    return material_fitter(task.model).summarise(problem, task.material)
