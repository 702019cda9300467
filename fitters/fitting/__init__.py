"""Fits: the problem (cells, light weights, target values), the metric, and the best parameters per target."""

from fitters.fitting.cell_fit import Fit, fit_cells, refit_cells
from fitters.fitting.exact import exact_errors, model_errors
from fitters.fitting.problem import Problem, ProblemRecipe
from fitters.fitting.settings import FitSettings
from fitters.fitting.stages import (
    Candidate,
    Confirmed,
    ConfirmJob,
    Description,
    DescriptionJob,
    FitJob,
    confirm,
    describe,
    fit_formula,
    screen,
    transfer,
)
from fitters.judging.metrics import RESIDUALS

__all__ = [
    "RESIDUALS",
    "Candidate",
    "ConfirmJob",
    "Confirmed",
    "Description",
    "DescriptionJob",
    "Fit",
    "FitJob",
    "FitSettings",
    "Problem",
    "ProblemRecipe",
    "confirm",
    "describe",
    "exact_errors",
    "fit_cells",
    "fit_formula",
    "model_errors",
    "refit_cells",
    "screen",
    "transfer",
]
