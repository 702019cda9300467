"""`gpsearch export RUN`: what a run found, in the form of an export target."""

from collections.abc import Mapping
from pathlib import Path

import click

from gpsearch.commands.described import described
from gpsearch.commands.runs import make_folder, run_argument, write_text
from gpsearch.errors import GpsearchError
from gpsearch.exports import TARGETS, Target
from gpsearch.run import Baseline, FoundFormula, Result

_FORMATS = "\n".join(f"  {target.name:12s} {target.meaning}" for target in TARGETS.values())

HELP = f"""Writes what RUN found. A run that was stopped is described and culled first.

\b
Formats:
{_FORMATS}
"""


@click.command(help=HELP)
@run_argument
@click.option("--format", "name", type=click.Choice(list(TARGETS)), default=next(iter(TARGETS)), show_default=True)
@click.option(
    "--member",
    "names",
    multiple=True,
    metavar="ID",
    help="A formula of the front, or a baseline; by default all formulas.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="A file, or a folder for several; a single file goes to standard output by default.",
)
def export(run: Path, name: str, names: tuple[str, ...], output: Path | None) -> None:
    target = TARGETS[name]
    if names and not target.per_member:
        raise click.UsageError(f"--member: {name} is about the whole run; leave it out.")
    result = described(run)
    write_files(target.files(result, members(target, result, names)), output)


def members(target: Target, result: Result, names: tuple[str, ...]) -> list[FoundFormula | Baseline]:
    """The entries with these names, or all formulas. Raises `GpsearchError` where there is none."""
    if names:
        return [result.entry(name) for name in dict.fromkeys(names)]
    if target.per_member and not result.formulas:
        raise GpsearchError(f"{result.run.name}: no formula of its front is described yet; export it again later")
    return list(result.formulas)


def write_files(files: Mapping[str, str], output: Path | None) -> None:
    """Writes a single file to `output` or to standard output, several into the folder `output`."""
    if len(files) == 1 and (output is None or not output.is_dir()):
        text = next(iter(files.values()))
        if output is None:
            click.echo(text, nl=False)
        else:
            write_text(output, text)
        return
    if output is None:
        raise click.UsageError(f"-o: {len(files)} files need a folder; name one, or choose one --member.")
    make_folder(output)
    for file, text in files.items():
        write_text(output / file, text)
