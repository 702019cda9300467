"""How much of published formulas can go for how much error: `python -m tests.benchmarks.culling [--data FOLDER]`.

Every formula is fitted to the materials of `tests.benchmarks.problem`, all together, and culled at every
tolerance.
"""

from pathlib import Path

import click

from fitters.expressions import parse, to_text
from fitters.expressions.catalogue import formula
from fitters.fitting import (
    ConfirmJob,
    DescriptionJob,
    FitJob,
    FitSettings,
    Problem,
    confirm,
    describe,
)
from fitters.fitting.culling import CullJob, cull
from tests.benchmarks.problem import data_folder, recipe
from tests.benchmarks.table import Cell, Table

FORMULAS = ("cook-torrance", "ggx", "abc", "genbrdf-metal")
TOLERANCES = (0.001, 0.01, 0.05)


@click.command()
@click.argument("formulas", nargs=-1)
@click.option(
    "--data",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    default=data_folder,
    help="Folder with rgl/ and envmaps/; without one, built-in materials and light.",
)
def main(formulas: tuple[str, ...], data: Path | None) -> None:
    """Prints what is left of FORMULAS, names of the catalogue."""
    problem = recipe(data).build()
    click.echo(culled(problem, formulas or FORMULAS).text())


def culled(problem: Problem, formulas: tuple[str, ...]) -> Table:
    """A row for each formula and tolerance; errors over all cells."""
    rows: list[tuple[Cell, ...]] = []
    for name in formulas:
        published = formula(name)
        bounds = tuple((symbol, low, high) for symbol, (low, high) in published.bounds.items())
        job = FitJob((to_text(published.expression),), bounds, FitSettings())
        whole = describe(problem, DescriptionJob(job, confirm(problem, ConfirmJob(job)).fit))
        rows.append((name, None, published.expression.nodes, whole.fit.error, None, job.expressions[0]))
        for tolerance in TOLERANCES:
            left = cull(problem, CullJob(job, whole, tolerance))
            error = (left.description or whole).fit.error
            growth = 100 * (error / whole.fit.error - 1)
            rows.append(
                (name, tolerance, parse(left.expression).nodes, error, f"{growth:+.2f} %", left.expression)
            )
    return Table(
        f"Culling formulas refitted to {', '.join(problem.names)}",
        ("formula", "tolerance", "nodes", "error", "change", "what is left"),
        tuple(rows),
    )


if __name__ == "__main__":
    main()
