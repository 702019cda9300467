"""Where methods fail: every method of fitting on every hazard, compared with a known truth."""

from fitters.stability.hazards import HAZARDS
from fitters.stability.methods import METHODS
from fitters.stability.trial import Outcome, Trial, failed, level_names, run_trial, skipped, trials_of
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
