"""A fitted formula as a model of one of the materials that it was fitted to."""

import numpy as np

from fitters.expressions import Expression
from fitters.fitting.fit import Fit
from fitters.fitting.problem import CHANNELS
from fitters.models import FormulaModel


def formula_model(expression: Expression, fit: Fit, material: int, seconds: float) -> FormulaModel:
    """The model of a problem's material; `seconds` is what the fit to all its materials took."""
    targets = range(len(CHANNELS) * material, len(CHANNELS) * (material + 1))
    parameters = [[fit.parameters(target)[name] for name in expression.parameters] for target in targets]
    model = FormulaModel(expression, np.array(parameters).reshape(len(CHANNELS), len(expression.parameters)))
    model.fit_seconds = seconds
    return model
