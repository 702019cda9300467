"""`gpsearch chart-search RUN...`: how the error fell while runs searched."""

from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from gpsearch.commands.progress import duration
from gpsearch.commands.runs import json_option, print_json
from gpsearch.pictures.search_chart import search_chart
from gpsearch.pictures.search_curves import Curve, SearchedRun, curves
from gpsearch.run import open_run


@click.command("chart-search")
@click.argument("runs", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="A folder; that of the first RUN by default."
)
@json_option
def chart_search(runs: tuple[Path, ...], output: Path | None, as_json: bool) -> None:
    """Draws the best error on the front of each RUN against the time that it had searched.

    Leaves search.png, search.svg, search.html (to explore, offline) and search.csv. All RUNS have the same
    materials, scene and metric; those of one name that differ in their seeds are repetitions, drawn with their
    median.
    """
    searched = [_read(run) for run in dict.fromkeys(runs)]
    files = search_chart(searched, output or runs[0])
    drawn = curves(searched)
    if as_json:
        print_json({"runs": [_entry(curve) for curve in drawn], "files": {k: str(p) for k, p in files.items()}})
        return
    for curve in drawn:
        best = curve.steps[-1]
        click.echo(
            f"{curve.name}, seed {curve.seed}: error {best.error:.4f} at {best.nodes} nodes"
            f" after {duration(best.seconds)} of {duration(curve.seconds)},"
            f" {curve.candidates:,} candidates, hypervolume {best.hypervolume:.3f}"
        )
    click.echo(f"chart: {'  '.join(map(str, files.values()))}")


def _read(folder: Path) -> SearchedRun:
    store, configuration = open_run(folder)
    with closing(store):
        return SearchedRun.of(folder, store, configuration)


def _entry(curve: Curve) -> dict[str, Any]:
    return asdict(curve) | {"run": str(curve.run)}
