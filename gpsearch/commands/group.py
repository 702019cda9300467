"""The command group, and how every command ends: 0 well, 1 failed, 2 bad input, 130 by Ctrl-C, 143 by SIGTERM.

A command is imported when it is called: `gpsearch --version` and `--help` need none of what the commands need.
"""

import sqlite3
import sys
from importlib import import_module

import click

from gpsearch import __version__
from gpsearch.commands.signals import Terminated

COMMANDS = {
    "chart": ("chart:chart", "Charts every model of RUN: error against evaluation time."),
    "chart-search": ("chart_search:chart_search", "Draws the best error of each RUN against the work done."),
    "export": ("export:export", "Writes the front of RUN (gpsearch-front/1)."),
    "fit": ("fit:fit", "Fits MODEL to MATERIALs and says how well it explains them."),
    "judge": ("judge:judge", "Judges models in pictures of a scene and on the table."),
    "launch": ("launch:launch", "Runs the search of CONFIG, or goes on with it."),
    "materials": ("materials:materials", "Prints what is in FILES of measured materials."),
    "pick": ("pick:pick_command", "Picks the cheapest model within a tolerance."),
    "stability": ("stability:stability", "Tries every method of fitting on known difficulties."),
    "status": ("status:status", "Says where RUN stands, while it runs or after."),
    "transfer": ("transfer:transfer_command", "Refits the models of RUN to other materials."),
}
"""Of each command: its module in this folder and its function there, and its line in `gpsearch --help`."""


class _LazyGroup(click.Group):
    """The commands of `COMMANDS`, each imported when it is asked for."""

    def list_commands(self, context: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        module, _, function = COMMANDS[name][0].partition(":")
        command: click.Command = getattr(import_module(f"gpsearch.commands.{module}"), function)
        return command

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="gpsearch")
def commands() -> None:
    """Finds the smallest, fastest analytic BRDF that reproduces measured materials in a scene."""


def main() -> None:
    """The console command `gpsearch`: errors of the packages become one message and an exit status."""
    try:
        commands(standalone_mode=False)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except sqlite3.DatabaseError as error:
        _complain(f"the run's store cannot be read ({error}); restore it from a copy, or choose another --run")
        sys.exit(2)
    except Terminated:
        sys.exit(143)
    except (KeyboardInterrupt, click.Abort):
        click.echo("interrupted", err=True)
        sys.exit(130)
    except BrokenPipeError:
        # The reader of the output has ended, as `head` does.
        sys.stderr.close()
        sys.exit(1)
    except Exception as error:
        status = _status(error)
        if status is None:
            raise
        _complain(error)
        sys.exit(status)


def _status(error: Exception) -> int | None:
    """The exit status that an error of the three packages means; None for any other error."""
    # Imported here, since a package runs its __init__ first, and only an error needs them.
    from fitters.errors import FittersError
    from gpsearch.errors import GpsearchError, StoreError
    from workers.errors import WorkersError

    if isinstance(error, StoreError):
        return 1
    if isinstance(error, GpsearchError | FittersError):
        return 2
    if isinstance(error, WorkersError):
        # A file that no worker can read is bad input all the same.
        return 2 if isinstance(error.__cause__, FittersError) else 1
    return None


def _complain(error: Exception | str) -> None:
    click.echo(f"gpsearch: {error}", err=True)
