"""A fitted formula as a model: one expression, one set of parameters a channel."""

from functools import cached_property

import numpy as np

from fitters.engine.cost import cost_ns
from fitters.errors import FittersError
from fitters.expressions import Expression, parse, to_text
from fitters.expressions.evaluation import evaluate_features, features, parameter_free
from fitters.grid import Array
from fitters.models.directions import both_above, rows
from fitters.models.half_vector import HalfVectorSampling
from fitters.models.model import Model

RECIPROCITY = 1e-6
"""A formula counts as reciprocal where no random pair of directions differs by more, relative."""


class FormulaModel(HalfVectorSampling, Model):
    """An expression with `parameters` (3, k), columns in the order of its own names; values below zero are 0."""

    kind = "formula"

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

    def cost_ns(self) -> float:
        return cost_ns(self.expression)

    def arrays(self) -> dict[str, np.ndarray]:
        return {"expression": np.array(to_text(self.expression)), "parameters": self.parameters}

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "FormulaModel":
        return cls(parse(str(arrays["expression"])), arrays["parameters"])
