"""`gpsearch export RUN`: the front as JSON."""

from pathlib import Path

import click

from gpsearch.commands.described import described
from gpsearch.commands.runs import run_argument, write_text


@click.command()
@run_argument
@click.option("--format", "form", type=click.Choice(["json"]), default="json", show_default=True)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="A file; standard output by default.")
def export(run: Path, form: str, output: Path | None) -> None:
    """Writes the front of RUN (gpsearch-front/1). A run that was stopped is described and culled first."""
    text = described(run).to_text()
    if output is None:
        click.echo(text, nl=False)
    else:
        write_text(output, text)
