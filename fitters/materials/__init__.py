"""Measured materials: MERL and RGL files and a few built-in ones, all as tables on one grid."""

from fitters.materials.loading import load_material
from fitters.materials.material import Material
from fitters.materials.summary import MaterialSummary, summarise
from fitters.materials.synthetic import builtin_names

__all__ = ["Material", "MaterialSummary", "builtin_names", "load_material", "summarise"]
