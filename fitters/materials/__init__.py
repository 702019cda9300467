"""Measured materials: MERL and RGL files and a few built-in ones, all as tables on one grid; UTIA files apart."""

from fitters.materials.loading import is_anisotropic, load_anisotropic, load_material
from fitters.materials.material import Material
from fitters.materials.summary import MaterialSummary, summarise
from fitters.materials.synthetic import builtin_names
from fitters.materials.utia import AnisotropicMaterial

__all__ = [
    "AnisotropicMaterial",
    "Material",
    "MaterialSummary",
    "builtin_names",
    "is_anisotropic",
    "load_anisotropic",
    "load_material",
    "summarise",
]
