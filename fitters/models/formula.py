"""Formulas as models: an expression and its parameters for each channel, fitted to all materials together."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from fitters.engine.cost import cost_ns
from fitters.errors import FittersError
from fitters.expressions import Expression, parse, to_text
from fitters.expressions.catalogue import CATALOGUE, formula
from fitters.expressions.evaluation import evaluate_features, features, parameter_free
from fitters.fitting.cell_fit import Fit
from fitters.fitting.problem import Problem
from fitters.fitting.settings import BOUNDS, Bounds, FitSettings, Intervals, intervals
from fitters.fitting.stages import ConfirmJob, DescriptionJob, FitJob, confirm, describe, fit_formula
from fitters.grid import CHANNELS, Array
from fitters.models.directions import both_above, rows
from fitters.models.fitted import Fitted, MaterialFit, PerChannel
from fitters.models.fitter import Family, FitStage, Fitter, FormulaBaseline, Stages
from fitters.models.half_vector import HalfVectorSampling
from fitters.models.model import Model
from fitters.models.model_code import ModelCode

RECIPROCITY = 1e-6
"""A formula counts as reciprocal where no random pair of directions differs by more, relative."""


class FormulaModel(HalfVectorSampling, Model):
    """An expression with `parameters` (3, k), columns in the order of its own names; values below zero are 0."""

    kind = "formula"

    expression: Expression

    def __init__(self, expression: Expression, parameters: Array):
        self.expression = expression
        self.parameters = np.asarray(parameters, np.float64)
        if self.parameters.shape != (3, len(expression.parameters)):
            raise FittersError(
                f"{to_text(expression)} takes parameters (3, {len(expression.parameters)}), one row a channel, "
                f"not {self.parameters.shape}"
            )

    @property
    def floats(self) -> int:
        return self.parameters.size

    @cached_property
    def reciprocal(self) -> bool:
        rng = np.random.default_rng(0)
        w = rng.normal(size=(2, 500, 3))
        w[..., 2] = np.abs(w[..., 2]) + 0.05
        w /= np.linalg.norm(w, axis=-1, keepdims=True)
        forth, back = self.evaluate(w[0], w[1]), self.evaluate(w[1], w[0])
        return bool(np.all(np.abs(forth - back) <= RECIPROCITY * np.maximum(forth, back)))

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        w_i, w_o = rows(w_i), rows(w_o)
        above = both_above(w_i, w_o)
        values = np.zeros((len(w_i), 3))
        seen = features(w_i[above], w_o[above])
        shared = parameter_free(self.expression, seen)
        for channel in range(3):
            given = dict(zip(self.expression.parameters, self.parameters[channel].tolist(), strict=True))
            values[above, channel] = evaluate_features(self.expression, given, seen, shared)
        return np.maximum(np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0), 0.0)

    @property
    def named_parameters(self) -> dict[str, PerChannel]:
        columns = self.parameters.T.tolist()
        return {name: (r, g, b) for name, (r, g, b) in zip(self.expression.parameters, columns, strict=True)}

    def scalar_code(self) -> ModelCode:
        from fitters.backends.scalar_code import ScalarCode

        code = ScalarCode.of(self.expression)
        formula = code.function()

        def call(w_i, w_o, tables, values):
            formula(w_i, w_o, tables, values)

        return ModelCode(call, (code.prepared(self.parameters),))

    def cost_ns(self) -> float:
        return cost_ns(self.expression)

    def arrays(self) -> dict[str, np.ndarray]:
        return {"expression": np.array(to_text(self.expression)), "parameters": self.parameters}

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "FormulaModel":
        return cls(parse(str(arrays["expression"])), arrays["parameters"])


def formula_models(expression: Expression, fit: Fit, seconds: float) -> list[FormulaModel]:
    """The models of the materials that an expression was fitted to together, which took `seconds`."""
    values = np.array(
        [[fit.parameters(target)[name] for name in expression.parameters] for target in range(len(fit.values))]
    )
    models = []
    for rows_of_material in values.reshape(-1, len(CHANNELS), len(expression.parameters)):
        model = FormulaModel(expression, rows_of_material)
        model.fit_seconds = seconds
        models.append(model)
    return models


PUBLISHED = Family("formula", "published, refitted", "#c4572b")


@dataclass(frozen=True, eq=False)
class FormulaFitter(Fitter):
    """An expression, each parameter of which is fitted within its interval.

    Options of `fit`: `settings` (`FitSettings`), and `bounds`, by parameter or one interval for all of them.
    """

    name: str
    expression: Expression
    bounds: Intervals
    family: Family = PUBLISHED
    model: type[Model] = FormulaModel
    together: ClassVar[bool] = True

    @classmethod
    def of_expression(cls, expression: Expression, name: str = "") -> "FormulaFitter":
        """An expression that is no published formula: all its parameters have the same bounds."""
        bounds = tuple((symbol, *BOUNDS) for symbol in expression.parameters)
        return cls(name or to_text(expression), expression, bounds)

    @property
    def options(self) -> tuple[str, ...]:
        return ("settings", "bounds")

    def job(self, settings: FitSettings, bounds: Bounds | tuple[float, float] | None = None) -> FitJob:
        """The fit as a value that travels."""
        if bounds is None:
            chosen = self.bounds
        elif isinstance(bounds, tuple):
            chosen = tuple((name, *bounds) for name in self.expression.parameters)
        else:
            chosen = intervals(bounds)
        return FitJob((to_text(self.expression),), chosen, settings)

    def _fit(self, problem: Problem, **options: Any) -> Fitted:
        job = self.job(options.get("settings") or FitSettings(), options.get("bounds"))
        description, seconds = fit_formula(problem.ready(), job)
        if not math.isfinite(description.fit.error):
            raise FittersError(
                f"{to_text(self.expression)} is not finite on every cell that {problem.scene_name} lights, "
                "whatever its parameters: keep divisors, logarithms and roots away from 0 over the hemisphere"
            )
        fit = description.fit
        errors = fit.errors.reshape(-1, len(CHANNELS)).tolist()
        models = formula_models(self.expression, fit, seconds)
        return Fitted(
            name=self.name,
            fits={
                name: MaterialFit(model, remarks=_remarks(model))
                for name, model in zip(problem.names, models, strict=True)
            },
            metric=problem.metric.name,
            errors={name: (r, g, b) for name, (r, g, b) in zip(problem.names, errors, strict=True)},
            metrics=description.metrics,
            fit_seconds=seconds,
            warnings=description.warnings,
        )

    def stages(self, materials: int, settings: FitSettings) -> Stages:
        job = self.job(settings)
        (confirmed,) = yield FitStage(confirm, (ConfirmJob(job),), f"{self.name} baseline", 10.0)
        task = DescriptionJob(job, confirmed.fit)
        (description,) = yield FitStage(describe, (task,), f"describe {self.name}", 1.0)
        return FormulaBaseline(description, confirmed.seconds)

    def count_tasks(self, materials: int) -> int:
        return 2


def _remarks(model: FormulaModel) -> tuple[str, str, str]:
    """The parameters of each channel."""
    r, g, b = (
        "  ".join(f"{name} {values[channel]:.5g}" for name, values in model.named_parameters.items())
        for channel in range(len(CHANNELS))
    )
    return r, g, b


def published(name: str) -> FormulaFitter:
    """The fitter of a catalogue formula. Raises `FittersError` with the nearest name."""
    entry = formula(name)
    return FormulaFitter(name, entry.expression, intervals(entry.bounds))


FITTERS: tuple[Fitter, ...] = tuple(map(published, CATALOGUE))
