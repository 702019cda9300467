"""Non-parametric factor models of isotropic materials (Bagher et al. 2016): tables fitted instead of formulas."""

from fitters.models.factors.fitting import (
    FactorFit,
    StartReport,
    fit_bivariate,
    fit_g_from_d,
    fit_independent_g,
    fit_naive,
)
from fitters.models.factors.tables import BivariateTable, MicrofacetFactors, NaiveFactors, SmithFactors

__all__ = [
    "BivariateTable",
    "FactorFit",
    "MicrofacetFactors",
    "NaiveFactors",
    "SmithFactors",
    "StartReport",
    "fit_bivariate",
    "fit_g_from_d",
    "fit_independent_g",
    "fit_naive",
]
