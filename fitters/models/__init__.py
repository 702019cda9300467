"""One contract for every model, and one registry: formulas, factor tables, power iterations, the measured table.

`Model` is the reflectance of one material; a `Fitter` makes one, or one for each material of a problem (`Fitted`).
"""

from fitters.models.model import Model  # isort: skip
from fitters.models.fitted import Fitted, MaterialFit  # isort: skip
from fitters.models.measured import MeasuredTable  # isort: skip
from fitters.models.formula import FormulaFitter, FormulaModel  # isort: skip
from fitters.models.fitter import (
    Baseline,
    Family,
    FitStage,
    FitSummary,
    Fitter,
    FormulaBaseline,
    MaterialFitter,
    MaterialTask,
    TabulatedBaseline,
)
from fitters.models.registry import (
    BASELINES,
    FAMILIES,
    KINDS,
    MODELS,
    fit,
    fitter_of,
    load,
    material_fitter,
    summarise,
    warm_up,
)

__all__ = [
    "BASELINES",
    "FAMILIES",
    "KINDS",
    "MODELS",
    "Baseline",
    "Family",
    "FitStage",
    "FitSummary",
    "Fitted",
    "Fitter",
    "FormulaBaseline",
    "FormulaFitter",
    "FormulaModel",
    "MaterialFit",
    "MaterialFitter",
    "MaterialTask",
    "MeasuredTable",
    "Model",
    "TabulatedBaseline",
    "fit",
    "fitter_of",
    "load",
    "material_fitter",
    "summarise",
    "warm_up",
]
