"""Reference fits by name: how well a material can be explained by what is no formula found by search."""

from fitters.models.baselines.fitted import Fitted
from fitters.models.baselines.formulas import formula_model
from fitters.models.baselines.judging import (
    BaselineJob,
    Judged,
    judge,
    judge_anisotropic,
    judge_at,
    judge_baseline,
)
from fitters.models.baselines.kept import kept_baseline
from fitters.models.baselines.names import (
    ANISOTROPIC,
    FACTORS,
    FAMILIES,
    KINDS,
    TABULATED,
    fit_baseline,
    of_anisotropic,
    unknown,
    warm_up,
)

__all__ = [
    "ANISOTROPIC",
    "FACTORS",
    "FAMILIES",
    "KINDS",
    "TABULATED",
    "BaselineJob",
    "Fitted",
    "Judged",
    "fit_baseline",
    "formula_model",
    "judge",
    "judge_anisotropic",
    "judge_at",
    "judge_baseline",
    "kept_baseline",
    "of_anisotropic",
    "unknown",
    "warm_up",
]
