"""Fits: the problem (cells, light weights, target values), the metric, and the best parameters per target."""

from fitters.fits.fit import Fit, FitSettings, exact_errors, fit, refit
from fitters.fits.metrics import METRICS
from fitters.fits.problem import FitProblem, fit_problem

__all__ = ["METRICS", "Fit", "FitProblem", "FitSettings", "exact_errors", "fit", "fit_problem", "refit"]
