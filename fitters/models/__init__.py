"""One contract for every model of a material: formulas, factor tables, power iterations, the raw table."""

from fitters.models.formula import FormulaModel
from fitters.models.measured import MeasuredTable
from fitters.models.model import Model

__all__ = ["FormulaModel", "MeasuredTable", "Model"]
