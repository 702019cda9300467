"""Reference fits by name: how well a material can be explained by what is no formula found by search."""

from fitters.baselines.fitted import Fitted
from fitters.baselines.judging import BaselineJob, Judged, judge, judge_baseline
from fitters.baselines.names import KINDS, TABULATED, fit_baseline, of_anisotropic

__all__ = [
    "KINDS",
    "TABULATED",
    "BaselineJob",
    "Fitted",
    "Judged",
    "fit_baseline",
    "judge",
    "judge_baseline",
    "of_anisotropic",
]
