"""`gpsearch fit` for formulas: a catalogue name or an expression, fitted to all materials together."""

import math
import re
from pathlib import Path

from fitters.errors import FittersError
from fitters.expressions import Expression, parse, to_text
from fitters.expressions.catalogue import CATALOGUE, formula
from fitters.fitting import (
    ConfirmJob,
    Description,
    DescriptionJob,
    FitJob,
    FitProblem,
    FitSettings,
    ProblemRecipe,
    build_problem,
    confirm,
    describe,
)
from fitters.fitting.problem import CHANNELS
from fitters.models.baselines import formula_model, unknown
from gpsearch.commands.fit_outcome import Outcome, Request, channel_lines, named
from gpsearch.configuration import FitSection, SearchSection
from gpsearch.errors import GpsearchError

Bounds = tuple[tuple[str, float, float], ...]


def fit_formula(request: Request) -> Outcome:
    """Raises `FittersError` or `GpsearchError` for what cannot be fitted."""
    expression, bounds = _formula(request.model)
    problem = build_problem(_recipe(request))
    job = FitJob((to_text(expression),), bounds, FitSettings())
    confirmed = confirm(problem, ConfirmJob(job))
    if not math.isfinite(confirmed.fit.error):
        raise GpsearchError(
            f"{to_text(expression)} is not finite on every cell that {request.light} lights, whatever its "
            "parameters: keep divisors, logarithms and roots away from 0 over the whole hemisphere"
        )
    description = describe(problem, DescriptionJob(job, confirmed.fit))
    models = tuple(
        formula_model(expression, description.fit, i, confirmed.seconds) for i in range(len(problem.materials))
    )
    report = _report(request, expression, problem, description, confirmed.seconds)
    return Outcome(report, _text(request, expression, problem, description, confirmed.seconds), models)


def _formula(model: str) -> tuple[Expression, Bounds]:
    """A catalogue formula, or an expression, whose parameters have the search's bounds."""
    if model in CATALOGUE:
        published = formula(model)
        return published.expression, tuple((name, *b) for name, b in published.bounds.items())
    try:
        expression = parse(model)
    except FittersError:
        if re.fullmatch(r"[A-Za-z][\w-]*", model):
            raise unknown(model) from None
        raise
    low, high = SearchSection().bounds
    return expression, tuple((name, low, high) for name in expression.parameters)


def _recipe(request: Request) -> ProblemRecipe:
    defaults = FitSection()
    return ProblemRecipe(
        materials=request.materials,
        scene=request.seen,
        metric=request.metric,
        sample_cells=defaults.cells,
        fine_cells=defaults.confirm_cells,
        seed=0,
        folder=str(Path.cwd()),
    )


def _report(
    request: Request, expression: Expression, problem: FitProblem, description: Description, seconds: float
) -> dict:
    found, names = description.fit, problem.materials
    return {
        "model": request.model,
        "expression": to_text(expression),
        **named(names),
        "scene": request.light,
        "metric": request.metric,
        "fit_seconds": round(seconds, 3),
        "floats": len(found.names) * len(CHANNELS),
        "warnings": list(description.warnings),
        "error": found.error,
        "errors": {name: found.errors[3 * i : 3 * i + 3].tolist() for i, name in enumerate(names)},
        "parameters": {
            symbol: {name: found.values[3 * i : 3 * i + 3, column].tolist() for i, name in enumerate(names)}
            for column, symbol in enumerate(found.names)
        },
        "metrics": description.metrics,
    }


def _text(
    request: Request, expression: Expression, problem: FitProblem, description: Description, seconds: float
) -> str:
    found = description.fit
    lines = [
        f"{request.model}: {request.metric} error {found.error:.4f}, {seconds:.1f} s",
        f"  {to_text(expression)}",
    ]
    for i, name in enumerate(problem.materials):
        targets = range(3 * i, 3 * i + 3)
        remarks = ["  ".join(f"{k} {v:.5g}" for k, v in found.parameters(target).items()) for target in targets]
        lines += [name, *channel_lines(found.errors[3 * i : 3 * i + 3].tolist(), remarks)]
    return "\n".join(lines)
