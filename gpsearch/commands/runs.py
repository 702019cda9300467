"""What the commands share: arguments, and writing what they report."""

import json
import os
from pathlib import Path
from typing import Any

import click

run_argument = click.argument("run", type=click.Path(path_type=Path))
json_option = click.option("--json", "as_json", is_flag=True, help="One JSON object on standard output.")


def print_json(report: dict[str, Any]) -> None:
    click.echo(json.dumps(report, indent=2, allow_nan=False))


def write_text(path: Path, text: str) -> None:
    """Writes a file; what cannot be written is a usage error, not a traceback."""
    try:
        path.write_text(text)
    except OSError as error:
        raise click.ClickException(f"{path}: cannot be written ({error.strerror}); choose another -o") from None


def make_folder(path: Path) -> None:
    """Makes a folder for what a command writes; where it cannot be made or written, that is a usage error."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise click.ClickException(f"{path}: cannot be made ({error.strerror}); choose another -o") from None
    if not os.access(path, os.W_OK):
        raise click.ClickException(f"{path}: this may not be written; choose another -o")
