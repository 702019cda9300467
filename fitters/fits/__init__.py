"""Fits: the problem (cells, light weights, target values), the metric, and the best parameters per target."""

from fitters.fits.exact import exact_errors
from fitters.fits.fit import Fit, FitSettings, fit, refit
from fitters.fits.metrics import METRICS
from fitters.fits.problem import FitProblem, fit_problem
from fitters.fits.recipe import ProblemRecipe, build_problem
from fitters.fits.stages import (
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
from fitters.fits.transfer import transfer

__all__ = [
    "METRICS",
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
