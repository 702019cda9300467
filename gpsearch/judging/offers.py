"""What may be picked for a scene: contenders as the run left them, refitted in the scene, with numbers shared."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fitters.expressions import Expression, parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.fitting import ConfirmJob, Fit, FitJob, FitSettings, Problem, confirm, model_errors
from fitters.fitting.polish import polish
from fitters.fitting.sharing import Sharing, share
from fitters.grid import SHAPE
from fitters.judging.card import model_values
from fitters.judging.metrics import IMAGE_METRICS, METRICS, Compared
from fitters.judging.timing import closure, incoherent, measure
from fitters.materials import Material
from fitters.models import FormulaModel, Model
from fitters.models.formula import formula_models
from gpsearch.judging.contenders import Contender
from gpsearch.judging.scenes import NamedScene
from gpsearch.judging.tolerance import Tolerance

LIGHT = "light"
"""The one table metric that needs no more than the cells which the scene lights."""

Bounds = Mapping[str, tuple[float, float]]
Values = Mapping[str, Mapping[str, float]]
"""By material's name, by metric."""


@dataclass(frozen=True, eq=False)
class Offer:
    """Models of a contender as they would be used in a scene, and what the metrics say of them there.

    fitted_in:   `run` for as it is in the run, `scene` for refitted
    nanoseconds: per call, of three channels; None where it was not measured
    sharing:     of a formula's parameters; None for tables
    """

    contender: Contender
    fitted_in: str
    nanoseconds: float | None
    models: Mapping[str, Model]
    values: Values
    sharing: Sharing | None

    @property
    def nodes(self) -> int:
        """Of the formula; a table has none."""
        return self.contender.entry.nodes or 0

    def numbers(self, materials: int) -> int:
        """Stored for a number of materials."""
        return self.sharing.numbers(materials) if self.sharing else self.contender.entry.floats * materials

    def words(self, materials: int) -> int:
        """Nodes of the formula, once, and numbers: a word each."""
        return self.nodes + self.numbers(materials)


class View:
    """A scene in which models of materials are measured by the metrics of a tolerance, and by no others."""

    def __init__(self, scene: NamedScene, materials: Sequence[Material], tolerance: Tolerance) -> None:
        self.materials, self.tolerance = tuple(material.name for material in materials), tolerance
        self._image_metrics = [name for name in tolerance.metrics if name in IMAGE_METRICS]
        self._curved_metrics = [name for name in tolerance.metrics if name not in (LIGHT, *IMAGE_METRICS)]
        self._of_name = {material.name: material for material in materials}
        self._light = scene.light()
        self._sources = {material.name: Problem([material], self._light) for material in materials}
        # The map of an image is large: it is made where an image metric is asked for.
        self._image = scene.image() if self._image_metrics else None
        self._truths = {m.name: self._image.of_material(m) for m in materials} if self._image else {}

    def values(self, model: Model, name: str) -> dict[str, float]:
        """What each metric of the tolerance says of a model of a material."""
        material, values = self._of_name[name], {}
        if LIGHT in self.tolerance.metrics:
            values[LIGHT] = _mean(model_errors(self._sources[name], 0, model)[LIGHT])
        if self._image is not None:
            picture = self._image.of_model(model, material)
            for metric in self._image_metrics:
                values[metric] = IMAGE_METRICS[metric].compare(self._truths[name], picture).value
        if self._curved_metrics:
            compared = Compared(material, self._light, model_values(model, material).reshape(3, *SHAPE))
            values |= {metric: METRICS[metric].measure(compared).value for metric in self._curved_metrics}
        return values

    def holds(self, model: Model, name: str) -> bool:
        return self.tolerance.holds(self.values(model, name))


def _mean(errors: Sequence[float]) -> float:
    """The root mean square over channels."""
    return float(np.sqrt(np.mean(np.square(errors))))


@dataclass(frozen=True, eq=False)
class Refitter:
    """Refits formulas in a scene with this fit problem over the run's materials; `bounds` are the search's."""

    problem: Problem
    bounds: tuple[tuple[str, float, float], ...]
    settings: FitSettings

    def bounds_of(self, contender: Contender) -> Bounds:
        """Those that the contender was fitted in."""
        if contender.entry.kind == "formula" and contender.entry.name in CATALOGUE:
            return CATALOGUE[contender.entry.name].bounds
        return {name: (low, high) for name, low, high in self.bounds}

    def refitted(self, contender: Contender) -> dict[str, Model]:
        """Models of every material, the structure as it is; no worse in the scene's error than the run's."""
        expression, bounds = _expression(contender), self.bounds_of(contender)
        near = self.fit_of(contender.models, self.problem)
        job = FitJob((contender.entry.expression or "",), tuple((n, *b) for n, b in bounds.items()), self.settings)
        fit = confirm(self.problem, ConfirmJob(job, near.columns or None)).fit
        fit = polish(expression, self.problem.fine, self.problem.metric, bounds, fit)
        return _models(expression, fit, self.problem.names)

    def fit_of(self, models: Mapping[str, Model], problem: Problem) -> Fit:
        """Parameters of formula models as a fit to a problem's targets whose errors are unknown."""
        formulas = [models[name] for name in problem.names]
        values = np.concatenate([model.parameters for model in formulas if isinstance(model, FormulaModel)])
        expression = next(model.expression for model in formulas if isinstance(model, FormulaModel))
        errors = np.full(len(values), np.inf)
        return Fit(expression.parameters, values, errors, np.inf, 0)


def offers(
    contenders: Sequence[Contender],
    nanoseconds: Mapping[str, float],
    view: View,
    refitter: Refitter | None,
) -> Iterator[list[Offer]]:
    """For each contender what it offers: as it is, and refitted where there is a refitter for another scene.

    `nanoseconds` by contender's name, those that are known.
    """
    for contender in contenders:
        variants = {"run": contender.models}
        if refitter is not None and _is_whole_formula(contender, view):
            variants["scene"] = refitter.refitted(contender)
        yield [
            Offer(
                contender,
                fitted_in,
                nanoseconds.get(contender.entry.name),
                models,
                {name: view.values(model, name) for name, model in models.items()},
                Sharing.nothing(_expression(contender).parameters) if contender.entry.expression else None,
            )
            for fitted_in, models in variants.items()
        ]


class Sharer:
    """Lets a formula's parameters be shared as far as the tolerance holds in a view."""

    def __init__(self, refitter: Refitter, view: View) -> None:
        self._refitter, self._view = refitter, view
        self._known: dict[tuple[str, tuple[str, ...]], Offer | None] = {}

    def __call__(self, offer: Offer, names: tuple[str, ...]) -> Offer:
        """The offer with the fewest numbers for these materials, one or all; itself where nothing is shared."""
        if offer.sharing is None or not offer.sharing.names:
            return offer
        key = (offer.contender.entry.name, names)
        if key not in self._known:
            self._known[key] = self._shared(offer, names)
        return self._known[key] or offer

    def _shared(self, offer: Offer, names: tuple[str, ...]) -> Offer | None:
        whole = self._refitter.problem
        problem = whole if names == whole.names else whole.of_material(whole.names.index(names[0]))
        expression = _expression(offer.contender)

        def unnoticed(tied: Fit, free: Fit) -> bool:
            return all(self._view.holds(model, name) for name, model in _models(expression, tied, names).items())

        free = self._refitter.fit_of(offer.models, problem)
        shared = share(expression, problem, self._refitter.bounds_of(offer.contender), free, unnoticed)
        if shared.sharing == offer.sharing:
            return None
        models = _models(expression, shared.fit, names)
        values = {name: self._view.values(model, name) for name, model in models.items()}
        return replace(offer, fitted_in="scene", models=models, values=values, sharing=shared.sharing)


def measured_nanoseconds(contenders: Sequence[Contender]) -> dict[str, float]:
    """What a call of each costs on this machine at incoherent directions, by name, all timed in turns."""
    closures = {one.entry.name: closure(next(iter(one.models.values()))) for one in contenders if one.models}
    return {name: timing.ns for name, timing in measure(closures, incoherent()).items()}


def _expression(contender: Contender) -> Expression:
    return parse(contender.entry.expression or "")


def _models(expression: Expression, fit: Fit, names: Sequence[str]) -> dict[str, Model]:
    return dict(zip(names, formula_models(expression, fit, 0.0), strict=True))


def _is_whole_formula(contender: Contender, view: View) -> bool:
    return contender.entry.expression is not None and set(contender.models) == set(view.materials)
