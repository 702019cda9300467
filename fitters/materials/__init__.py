"""Measured materials: a registry of file formats and a few built-in ones, as tables on one grid."""

from fitters.materials.formats import FORMATS, is_anisotropic, load_anisotropic, load_material
from fitters.materials.material import Material
from fitters.materials.summary import MaterialSummary, summarise
from fitters.materials.synthetic import builtin_names
from fitters.materials.utia import AnisotropicMaterial

__all__ = [
    "FORMATS",
    "AnisotropicMaterial",
    "Material",
    "MaterialSummary",
    "builtin_names",
    "is_anisotropic",
    "load_anisotropic",
    "load_material",
    "summarise",
]
