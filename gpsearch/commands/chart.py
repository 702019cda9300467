"""`gpsearch chart RUN`: error against speed, fit time and size, of all that a run found and of its baselines."""

from pathlib import Path
from typing import Any

import click
from rich.console import Console

from fitters.grid import CELLS, CHANNELS
from gpsearch.commands.described import described
from gpsearch.commands.progress import counted
from gpsearch.commands.runs import json_option, make_folder, print_json, run_argument
from gpsearch.errors import GpsearchError
from gpsearch.judging.contenders import load_contenders, materials_of
from gpsearch.pictures.chart import (
    Chart,
    chart_of,
    table_row,
    timed_fits,
    timings,
    write_page,
    write_pictures,
    write_table,
)
from gpsearch.run import Result

FILES = ("chart.png", "chart.svg", "chart.html", "chart.csv")


@click.command()
@run_argument
@click.option("-o", "--output", type=click.Path(path_type=Path), help="A folder; that of the run by default.")
@json_option
def chart(run: Path, output: Path | None, as_json: bool) -> None:
    """Charts every model of RUN: error against ns per evaluation, time of the fit, nodes and floats.

    All are timed on this machine by one harness. Where there are test materials, the error on them stands beside
    the other. Writes chart.png, chart.svg, chart.html and chart.csv.
    """
    result = described(run)
    if not result.formulas and result.missing:
        raise GpsearchError(
            f"{run}: none of the {result.missing} formulas of its front is described yet; chart the run when the"
            " process that writes to it has ended"
        )
    if not result.formulas:
        raise GpsearchError(
            f"{run}: its front is empty, the run was stopped before it had found anything; `gpsearch launch` with "
            "its configuration goes on with it"
        )
    folder = output or run
    make_folder(folder)
    charted = _measured(result)
    paths = {Path(name).suffix[1:]: folder / name for name in FILES}
    write_pictures(charted, (paths["png"], paths["svg"]))
    write_page(charted, paths["html"])
    write_table(charted, paths["csv"])
    report = _report(charted, paths)
    if as_json:
        print_json(report)
    else:
        click.echo(_text(charted, paths))


def _measured(result: Result) -> Chart:
    console = Console(stderr=True, markup=False, emoji=False, highlight=False)
    with console.status("loading materials and tables"):
        first = materials_of(result.source)[0]
        competing = load_contenders(result, [first])
    with console.status("timing evaluations"):
        incoherent, coherent, empty = timings(competing, first)
    fits = timed_fits(result.source, competing)
    seconds = dict(counted(fits, len(result.formulas), "timing fits"))
    return chart_of(result.run, competing, seconds, incoherent, coherent, empty, len(CHANNELS) * CELLS)


def _report(charted: Chart, paths: dict[str, Path]) -> dict[str, Any]:
    run = charted.run
    return {
        "run": run.name,
        "metric": run.metric,
        "materials": list(run.materials),
        **({"test_materials": list(run.test_materials)} if run.test_materials else {}),
        "empty_ns": round(charted.empty.ns, 2),
        "models": [table_row(model, charted) for model in charted.models],
        "files": {form: str(path) for form, path in paths.items()},
    }


def _text(charted: Chart, paths: dict[str, Path]) -> str:
    """What no other model beats in error, speed and floats, and where the files are."""
    lines = ["no other model is better in error, time of an evaluation and floats at once:"]
    for model in sorted((m for m in charted.models if m.unbeaten_together), key=lambda m: m.cost("ns") or 0.0):
        test = f"test {model.entry.test_error:.4f}  " if model.entry.test_error is not None else ""
        costs = f"{model.cost('ns'):7.1f} ns  {model.entry.floats:9,d} floats"
        lines.append(f"  {model.title:32s} error {model.error:.4f}  {test}{costs}")
    lines.append(f"an empty call takes {charted.empty.ns:.1f} ns, which is in every figure")
    lines += [f"could not be fitted: {model.title}" for model in charted.unfitted]
    return "\n".join([*lines, *(f"{form}: {path}" for form, path in paths.items())])
