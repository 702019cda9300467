"""The baselines that are no formulas, by name, and how each is fitted to a material."""

import difflib
from collections.abc import Callable, Mapping
from typing import Any

from fitters import factors, power_iterations
from fitters.baselines.fitted import Fitted
from fitters.errors import FittersError
from fitters.expressions.catalogue import CATALOGUE
from fitters.factors import FactorFit
from fitters.materials import Material
from fitters.materials.utia import AnisotropicMaterial
from fitters.models import FormulaModel, MeasuredTable, Model
from fitters.power_iterations import Extraction

TABULATED: Mapping[str, Callable[[Material], Fitted]] = {
    "bivariate": lambda material: _of_factors(factors.fit_bivariate(material)),
    "npf-independent-g": lambda material: _of_factors(factors.fit_independent_g(material)),
    "npf-g-from-d": lambda material: _of_factors(factors.fit_g_from_d(material)),
    "npf-naive": lambda material: _of_factors(factors.fit_naive(material)),
    "power-iterations": lambda material: _of_extraction(power_iterations.extract(material)),
    "power-iterations-anisotropic": lambda material: of_anisotropic(material),
}

KINDS: Mapping[str, type[Model]] = {
    model.kind: model
    for model in (
        MeasuredTable,
        FormulaModel,
        factors.BivariateTable,
        factors.MicrofacetFactors,
        factors.SmithFactors,
        factors.NaiveFactors,
        power_iterations.TabulatedMicrofacet,
        power_iterations.AnisotropicMicrofacet,
    )
}
"""What a saved file may hold."""


def fit_baseline(name: str, material: Material) -> Fitted:
    """The baseline of that name, fitted to a material. Raises `FittersError` with the nearest name."""
    if name not in TABULATED:
        known = (*TABULATED, *CATALOGUE)
        near = difflib.get_close_matches(name, known, 1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
        raise FittersError(f"no baseline {name!r}: {hint}")
    return TABULATED[name](material)


def of_anisotropic(material: Material | AnisotropicMaterial) -> Fitted:
    """The anisotropic extraction, also of a material that only it can take."""
    return _of_extraction(power_iterations.extract_anisotropic(material))


def _of_factors(fit: FactorFit) -> Fitted:
    details: dict[str, Any] = {
        "objective": list(fit.objective),
        "iterations": [max(start.iterations[c] for start in fit.starts) for c in range(3)],
        "starts": [
            {
                "name": start.name,
                "objective": list(start.objective),
                "iterations": list(start.iterations),
                "searches": list(start.searches),
                "seconds": round(start.seconds, 3),
                "converged": start.converged,
            }
            for start in fit.starts
        ],
        "spread": list(fit.spread),
    }
    return Fitted(fit.model, details, fit.warnings)


def _of_extraction(found: Extraction) -> Fitted:
    details: dict[str, Any] = {
        "alpha_ggx": found.alpha_ggx,
        "alpha_beckmann": found.alpha_beckmann,
        "fresnel_at_normal": list(found.fresnel_at_normal),
        "fresnel": found.fresnel.tolist(),
        "iterations": found.iterations,
    }
    return Fitted(found.model, details, found.warnings)
