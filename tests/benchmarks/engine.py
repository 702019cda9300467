"""The benchmarks of the fit engine: `python -m tests.benchmarks.engine [SECTION ...] [--data FOLDER]`."""

import os
import platform
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import click

from fitters.engine.warm import warm_up
from fitters.fitting import Problem, ProblemRecipe
from tests.benchmarks import evaluation, fitting, growth, quality, search, stopping
from tests.benchmarks.problem import data_folder, recipe
from tests.benchmarks.table import Table

SECTIONS: dict[str, Callable[[Problem], Iterable[Table]]] = {
    "evaluation": evaluation.tables,
    "fitting": fitting.tables,
    "quality": quality.tables,
    "growth": growth.tables,
}
"""What is measured on a fit problem."""

SEARCHES: dict[str, Callable[[ProblemRecipe], Iterable[Table]]] = {
    "stopping": stopping.tables,
    "search": search.tables,
}
"""What takes a whole search."""


@click.command()
@click.argument("sections", nargs=-1, type=click.Choice([*SECTIONS, *SEARCHES]))
@click.option(
    "--data",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    default=data_folder,
    help="Folder with rgl/ and envmaps/; without one, built-in materials and light.",
)
def main(sections: tuple[str, ...], data: Path | None) -> None:
    """Prints the tables of the named sections, by default of all."""
    problem = recipe(data).build()
    warm_up()
    click.echo(
        f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}\n"
        f"{', '.join(problem.names)}: {len(problem.targets)} targets, {len(problem.full):,} lit cells, "
        f"{len(problem.fine):,} in the fine sample, {len(problem.sample):,} in the sample"
    )
    for name in sections or (*SECTIONS, *SEARCHES):
        started = time.perf_counter()
        for table in SECTIONS[name](problem) if name in SECTIONS else SEARCHES[name](recipe(data)):
            click.echo(f"\n{table.text()}")
        click.echo(f"\n{name}: {time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
