"""Where methods fail: every fitter against every hazard, with a truth that is known."""

from fitters.stability.hazards import HAZARDS
from fitters.stability.methods import METHODS
from fitters.stability.plan import level_names, skipped, trials_of
from fitters.stability.trial import Outcome, Trial, failed, run_trial
from fitters.stability.verdict import Cell, cells_of

__all__ = [
    "HAZARDS",
    "METHODS",
    "Cell",
    "Outcome",
    "Trial",
    "cells_of",
    "failed",
    "level_names",
    "run_trial",
    "skipped",
    "trials_of",
]
