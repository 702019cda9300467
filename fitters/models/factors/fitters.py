"""The factor models in the registry: how each is fitted to a material, and what is reported of it."""

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

from fitters.materials import Material
from fitters.models.factors.fitting import (
    FactorFit,
    fit_bivariate,
    fit_g_from_d,
    fit_independent_g,
    fit_naive,
)
from fitters.models.factors.tables import BivariateTable, MicrofacetFactors, NaiveFactors, SmithFactors
from fitters.models.fitted import MaterialFit
from fitters.models.fitter import Family, Fitter, MaterialFitter
from fitters.models.model import Model

SOLVERS = ("joint", "awls")
"""All factors together, which converges, or the paper's alternation."""

_FACTORS, _TABLE = Family("factors", "factor tables", "#7b6a9a"), Family("table", "table", "#4d8a6b")
_PACKAGES = (sys.modules[__package__],)


def _factors(
    model: type[Model],
    fit: Callable[..., FactorFit],
    quick: Callable[[Material], FactorFit] | None = None,
) -> MaterialFitter:
    def fitted(material: Material, solver: str = SOLVERS[0]) -> MaterialFit:
        return _material_fit(fit(material, solver=solver), solver)

    return MaterialFitter(
        name=model.kind,
        family=_FACTORS,
        model=model,
        fit_material=fitted,
        packages=_PACKAGES,
        solvers=SOLVERS,
        quick=quick and (lambda material: _material_fit(quick(material))),
    )


def _material_fit(fit: FactorFit, solver: str | None = None) -> MaterialFit:
    details: dict[str, Any] = {
        **({"solver": solver} if solver else {}),
        "objective": list(fit.objective),
        "start": [start.name for start in fit.kept],
        "iterations": [start.iterations[c] for c, start in enumerate(fit.kept)],
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
    r, g, b = (f"objective (eq. 7) {value:.5g}" for value in fit.objective)
    starts = ", ".join(start.name for start in fit.starts)
    notes = (f"starts {starts}; solver {solver}",) if solver else ()
    return MaterialFit(fit.model, fit.warnings, details, (r, g, b), notes)


FITTERS: tuple[Fitter, ...] = (
    MaterialFitter(
        name=BivariateTable.kind,
        family=_TABLE,
        model=BivariateTable,
        fit_material=lambda material: _material_fit(fit_bivariate(material)),
        packages=_PACKAGES,
    ),
    _factors(MicrofacetFactors, fit_independent_g, quick=partial(fit_independent_g, only=("slices",))),
    _factors(SmithFactors, fit_g_from_d),
    _factors(NaiveFactors, fit_naive),
)
