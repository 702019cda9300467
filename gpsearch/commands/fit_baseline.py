"""`gpsearch fit` for the baselines that are no formulas: each material has a model of its own."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fitters.fitting.problem import lit_source
from fitters.judging.metrics import COSINE, RESIDUALS
from fitters.materials import is_anisotropic, load_anisotropic, load_material
from fitters.models.baselines import (
    ANISOTROPIC,
    Fitted,
    fit_baseline,
    judge_anisotropic,
    judge_at,
    of_anisotropic,
)
from fitters.models.factors.fitting import Solver
from fitters.scenes import light_table
from gpsearch.commands.fit_outcome import Outcome, Request, channel_lines, named
from gpsearch.errors import GpsearchError

Errors = Mapping[str, Sequence[float]]


def fit_tabulated(request: Request, solver: Solver | None) -> Outcome:
    """A baseline fitted to isotropic materials and judged in the light, as formulas are."""
    light = light_table(request.seen, base=Path.cwd())
    source = lit_source([load_material(reference, base=Path.cwd()) for reference in request.materials], light)
    fits = {material.name: fit_baseline(request.model, material, solver=solver) for material in source.materials}
    judged = [judge_at(source, i, fitted.model) for i, fitted in enumerate(fits.values())]
    by_metric = {metric: np.array([errors[metric] for errors in judged]) for metric in RESIDUALS}
    scores = {metric: RESIDUALS[metric].combine(errors.ravel()) for metric, errors in by_metric.items()}
    errors = dict(zip(fits, by_metric[request.metric].tolist(), strict=True))
    return _outcome(request, fits, errors, {"scene": request.light, "metric": request.metric}, scores)


def fit_anisotropic(request: Request) -> Outcome:
    """The one baseline that takes anisotropic measurements, judged over their own samples."""
    if request.model != ANISOTROPIC:
        raise GpsearchError(f"{request.model} takes isotropic materials: only {ANISOTROPIC} takes .bin files")
    if not all(map(is_anisotropic, request.materials)):
        raise GpsearchError(
            "anisotropic .bin files are judged over their own samples, other materials in a light: fit them in "
            "two commands"
        )
    materials = [load_anisotropic(reference, base=Path.cwd()) for reference in request.materials]
    if len({material.name for material in materials}) < len(materials):
        raise GpsearchError("two of the materials have the same name: name each once")
    fits = {material.name: of_anisotropic(material) for material in materials}
    errors = {
        material.name: list(judge_anisotropic(material, fits[material.name].model)) for material in materials
    }
    score = COSINE.combine(np.ravel(list(errors.values())))
    return _outcome(request, fits, errors, {"metric": COSINE.name}, {COSINE.name: score})


def _outcome(
    request: Request,
    fits: Mapping[str, Fitted],
    errors: Errors,
    judged_in: dict[str, str],
    scores: dict[str, float],
) -> Outcome:
    models = tuple(fitted.model for fitted in fits.values())
    each = {name: fitted.details for name, fitted in fits.items()}
    several = len(fits) > 1
    report = {
        "model": request.model,
        **named(list(fits)),
        **judged_in,
        "fit_seconds": round(sum(model.fit_seconds for model in models), 3),
        "floats": models[0].floats,
        "warnings": [
            f"{name}: {said}" if several else said for name, fitted in fits.items() for said in fitted.warnings
        ],
        "error": scores[judged_in["metric"]],
        "errors": dict(errors),
        "metrics": scores,
        **({"fits": each} if several else next(iter(each.values()))),
    }
    return Outcome(report, _text(report, fits, errors), models)


def _text(report: dict[str, Any], fits: Mapping[str, Fitted], errors: Errors) -> str:
    lines = [
        f"{report['model']}: {report['metric']} error {report['error']:.4f}, {report['fit_seconds']:.2f} s, "
        f"{report['floats']:,} floats"
    ]
    for name, fitted in fits.items():
        lines += [name, *channel_lines(errors[name], _remarks(fitted.details)), *_whole(fitted.details)]
    return "\n".join(lines)


def _remarks(details: Mapping[str, Any]) -> list[str]:
    """What is reported of each channel besides its error."""
    if "objective" in details:
        return [f"objective (eq. 7) {value:.5g}" for value in details["objective"]]
    return [f"Fresnel term at normal incidence {value:.4f}" for value in details["fresnel_at_normal"]]


def _whole(details: Mapping[str, Any]) -> list[str]:
    """What is reported of all channels together."""
    if "solver" in details:
        return [f"  starts {', '.join(start['name'] for start in details['starts'])}; solver {details['solver']}"]
    if "alpha_ggx" not in details:
        return []
    return [f"  {name} {_numbers(details[name])}" for name in ("alpha_ggx", "alpha_beckmann")]


def _numbers(value: float | Sequence[float]) -> str:
    """One alpha, or alpha_x, alpha_y and their correlation."""
    return f"{value:.4f}" if isinstance(value, float) else "  ".join(f"{part:.4f}" for part in value)
