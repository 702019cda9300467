"""The baselines that are no formulas, by name, and how each is fitted to a material."""

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from fitters.errors import FittersError
from fitters.expressions.catalogue import CATALOGUE
from fitters.materials import AnisotropicMaterial, Material
from fitters.materials.synthetic import matte
from fitters.models import FormulaModel, MeasuredTable, Model, factors, power_iterations
from fitters.models.baselines.fitted import Fitted
from fitters.models.factors import FactorFit
from fitters.models.factors.fitting import Solver
from fitters.models.power_iterations import Extraction

ANISOTROPIC = "power-iterations-anisotropic"
"""The one that also takes anisotropic measurements, see `of_anisotropic`."""

FACTORS: Mapping[str, Callable[..., FactorFit]] = {
    "npf-independent-g": factors.fit_independent_g,
    "npf-g-from-d": factors.fit_g_from_d,
    "npf-naive": factors.fit_naive,
}
"""The factor models that either solver fits."""


def _solved(name: str, solver: Solver, material: Material) -> Fitted:
    fitted = _of_factors(FACTORS[name](material, solver=solver))
    return replace(fitted, details={"solver": solver, **fitted.details})


TABULATED: Mapping[str, Callable[[Material], Fitted]] = {
    "bivariate": lambda material: _of_factors(factors.fit_bivariate(material)),
    **{name: partial(_solved, name, "joint") for name in FACTORS},
    "power-iterations": lambda material: _of_extraction(power_iterations.extract(material)),
    ANISOTROPIC: lambda material: of_anisotropic(material),
}

FAMILIES: Mapping[str, str] = {
    "bivariate": "table",
    "npf-independent-g": "factors",
    "npf-g-from-d": "factors",
    "npf-naive": "factors",
    "power-iterations": "power-iterations",
    "power-iterations-anisotropic": "power-iterations",
}
"""What sort of model each of `TABULATED` is."""

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


def fit_baseline(name: str, material: Material, *, solver: Solver | None = None) -> Fitted:
    """The baseline of that name, fitted to a material; `solver` is joint or awls, for those of `FACTORS`.

    Raises `FittersError` with the nearest name, or for a solver that this baseline does not take.
    """
    if name not in TABULATED:
        raise unknown(name)
    if solver is not None and name not in FACTORS:
        raise FittersError(f"{name} has one way of being fitted: a solver is chosen for {', '.join(FACTORS)} only")
    # With more threads, BLAS adds up in another order, and the same fit ends in other last bits.
    with threadpool_limits(1, "blas"):
        fitted = TABULATED[name](material) if solver is None else _solved(name, solver, material)
    return replace(fitted, warnings=(*material.doubts, *fitted.warnings))


def warm_up(names: Iterable[str]) -> None:
    """Compiles what the fits of these baselines need, or loads it from the disk cache; others are left out.

    Several processes that begin to fit at once would all compile the same.
    """
    up = np.array([[0.0, 0.0, 1.0]])
    for name in names:
        if name == "npf-independent-g":
            factors.fit_independent_g(matte(), only=("slices",)).model.evaluate(up, up)
        elif name in TABULATED:
            TABULATED[name](matte()).model.evaluate(up, up)


def unknown(name: str) -> FittersError:
    """The error that names the baseline or published formula nearest to `name`."""
    known = (*CATALOGUE, *TABULATED)
    near = difflib.get_close_matches(name, known, 1)
    hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
    return FittersError(f"no formula or baseline {name!r}: {hint}")


def of_anisotropic(material: Material | AnisotropicMaterial) -> Fitted:
    """The anisotropic extraction, also of a material that only it can take."""
    return _of_extraction(power_iterations.extract_anisotropic(material))


def _of_factors(fit: FactorFit) -> Fitted:
    details: dict[str, Any] = {
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
