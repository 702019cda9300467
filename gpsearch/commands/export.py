"""`gpsearch export RUN`: the front as JSON."""

from pathlib import Path

import click
from rich.console import Console

from gpsearch.commands.progress import ProgressWatcher
from gpsearch.commands.runs import open_run, run_argument, write_text
from gpsearch.exports import front_json
from gpsearch.exports.front_json import to_text
from gpsearch.search.plan import plan
from gpsearch.search.references import unfinished
from gpsearch.search.search import Search
from workers import LocalSettings, open_executor


@click.command()
@run_argument
@click.option("--format", "form", type=click.Choice(["json"]), default="json", show_default=True)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="A file; standard output by default.")
def export(run: Path, form: str, output: Path | None) -> None:
    """Writes the front of RUN (gpsearch-front/1). A run that was stopped is described and culled first."""
    store, configuration = open_run(run)
    try:
        if unfinished(store, store.front().members):
            planned = plan(configuration)
            console = Console(stderr=True, markup=False, emoji=False, highlight=False)
            with open_executor(LocalSettings()) as executor, ProgressWatcher(console, planned.budget) as watcher:
                Search(planned, store, executor, watcher).describe_front()
        text = to_text(front_json(store, configuration))
    finally:
        store.close()
    if output is None:
        click.echo(text, nl=False)
    else:
        write_text(output, text)
