"""The models of power iterations in the registry: how each is fitted to a material, and what is reported of it."""

import sys
from collections.abc import Sequence
from typing import Any

from fitters.models.fitted import MaterialFit
from fitters.models.fitter import Family, Fitter, MaterialFitter
from fitters.models.power_iterations.anisotropic_model import AnisotropicMicrofacet
from fitters.models.power_iterations.extraction import Extraction, extract, extract_anisotropic
from fitters.models.power_iterations.model import TabulatedMicrofacet

_FAMILY = Family("power-iterations", "power iterations", "#a88a2a")
_PACKAGES = (sys.modules[__package__],)


def _material_fit(extraction: Extraction) -> MaterialFit:
    details: dict[str, Any] = {
        "alpha_ggx": extraction.alpha_ggx,
        "alpha_beckmann": extraction.alpha_beckmann,
        "fresnel_at_normal": list(extraction.fresnel_at_normal),
        "fresnel": extraction.fresnel.tolist(),
        "iterations": extraction.iterations,
    }
    r, g, b = (f"Fresnel term at normal incidence {value:.4f}" for value in extraction.fresnel_at_normal)
    notes = tuple(f"{name} {_numbers(details[name])}" for name in ("alpha_ggx", "alpha_beckmann"))
    return MaterialFit(extraction.model, extraction.warnings, details, (r, g, b), notes)


def _numbers(value: float | Sequence[float]) -> str:
    """One alpha, or alpha_x, alpha_y and their correlation."""
    return f"{value:.4f}" if isinstance(value, float) else "  ".join(f"{part:.4f}" for part in value)


FITTERS: tuple[Fitter, ...] = (
    MaterialFitter(
        name=TabulatedMicrofacet.kind,
        family=_FAMILY,
        model=TabulatedMicrofacet,
        fit_material=lambda material: _material_fit(extract(material)),
        packages=_PACKAGES,
    ),
    MaterialFitter(
        name=AnisotropicMicrofacet.kind,
        family=_FAMILY,
        model=AnisotropicMicrofacet,
        fit_material=lambda material: _material_fit(extract_anisotropic(material)),
        packages=_PACKAGES,
        takes_anisotropic=True,
    ),
)
