"""Fits: the problem (cells, light weights, target values), the metric, and the best parameters per target."""

from fitters.fitting.exact import exact_errors
from fitters.fitting.fit import Fit, FitSettings, fit, refit
from fitters.fitting.problem import FitProblem, fit_problem
from fitters.fitting.recipe import ProblemRecipe, build_problem
from fitters.fitting.stages import (
    Candidate,
    Confirmed,
    ConfirmJob,
    Description,
    DescriptionJob,
    FitJob,
    confirm,
    describe,
    screen,
)
from fitters.fitting.transfer import transfer
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
    "FitProblem",
    "FitSettings",
    "ProblemRecipe",
    "build_problem",
    "confirm",
    "describe",
    "exact_errors",
    "fit",
    "fit_problem",
    "refit",
    "screen",
    "transfer",
]
