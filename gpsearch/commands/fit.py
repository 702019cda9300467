"""`gpsearch fit MODEL MATERIAL...`: fits a catalogue formula or an expression."""

from pathlib import Path

import click

from fitters.expressions import parse, to_text
from fitters.expressions.catalogue import CATALOGUE, formula
from fitters.fits import (
    METRICS,
    ConfirmJob,
    DescriptionJob,
    FitJob,
    FitSettings,
    ProblemRecipe,
    build_problem,
    confirm,
    describe,
)
from fitters.fits.problem import CHANNELS
from fitters.scenes import Scene
from gpsearch.commands.runs import json_option, print_json
from gpsearch.configuration import FitSection, Search


@click.command()
@click.argument("model")
@click.argument("materials", nargs=-1, required=True)
@click.option("--light", default="studio", show_default=True, help="studio, overcast, or a .hdr or .exr map.")
@click.option("--metric", type=click.Choice(list(METRICS)), default="light", show_default=True)
@json_option
def fit(model: str, materials: tuple[str, ...], light: str, metric: str, as_json: bool) -> None:
    """Fits MODEL, a catalogue name or an expression over p0.., to MATERIALs under a light."""
    defaults = FitSection()
    recipe = ProblemRecipe(
        materials=materials,
        scene=Scene(light=light),
        metric=metric,
        sample_cells=defaults.cells,
        fine_cells=defaults.confirm_cells,
        seed=0,
        folder=str(Path.cwd()),
    )
    text, bounds = _model(model)
    problem = build_problem(recipe)
    job = FitJob((text,), bounds, FitSettings())
    confirmed = confirm(problem, ConfirmJob(job))
    description = describe(problem, DescriptionJob(job, confirmed.fit))
    found, names = description.fit, problem.materials
    report = {
        "model": model,
        "expression": text,
        "materials": list(names),
        "scene": light,
        "metric": metric,
        "fit_seconds": round(confirmed.seconds, 3),
        "floats": len(found.names) * len(CHANNELS),
        "warnings": [],
        "error": found.error,
        "errors": {name: found.errors[3 * i : 3 * i + 3].tolist() for i, name in enumerate(names)},
        "parameters": {
            symbol: {name: found.values[3 * i : 3 * i + 3, column].tolist() for i, name in enumerate(names)}
            for column, symbol in enumerate(found.names)
        },
        "metrics": description.metrics,
    }
    if as_json:
        print_json(report)
        return
    click.echo(f"{model}: {metric} error {found.error:.4f}, {confirmed.seconds:.1f} s\n  {text}")
    for i, name in enumerate(names):
        click.echo(f"{name}")
        for c, channel in enumerate(CHANNELS):
            values = "  ".join(f"{k} {v:.5g}" for k, v in found.parameters(3 * i + c).items())
            click.echo(f"  {channel:5s}  error {found.errors[3 * i + c]:.4f}  {values}")


def _model(model: str) -> tuple[str, tuple[tuple[str, float, float], ...]]:
    """Text and bounds of a catalogue formula, or of an expression, whose parameters have the search's bounds."""
    if model in CATALOGUE:
        published = formula(model)
        return to_text(published.expression), tuple((name, *b) for name, b in published.bounds.items())
    if model.replace("-", "").isidentifier() and not model.startswith("p"):
        formula(model)  # says which name is nearest
    expression = parse(model)
    low, high = Search().bounds
    return to_text(expression), tuple((name, low, high) for name in expression.parameters)
