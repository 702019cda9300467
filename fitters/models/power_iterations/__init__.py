"""Microfacet models extracted from materials by power iterations (Dupuy et al. 2015)."""

from fitters.models.power_iterations.anisotropic_model import AnisotropicMicrofacet
from fitters.models.power_iterations.extraction import Extraction, extract, extract_anisotropic
from fitters.models.power_iterations.model import TabulatedMicrofacet
from fitters.models.power_iterations.settings import Settings

__all__ = [
    "AnisotropicMicrofacet",
    "Extraction",
    "Settings",
    "TabulatedMicrofacet",
    "extract",
    "extract_anisotropic",
]
