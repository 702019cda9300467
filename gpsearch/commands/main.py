"""The command group, and how every command ends: 0 well, 1 failed, 2 bad input, 130 by Ctrl-C, 143 by SIGTERM."""

import sqlite3
import sys

import click

from fitters.errors import FittersError
from gpsearch import __version__
from gpsearch.commands.chart import chart
from gpsearch.commands.chart_search import chart_search
from gpsearch.commands.export import export
from gpsearch.commands.fit import fit
from gpsearch.commands.judge import judge
from gpsearch.commands.launch import launch
from gpsearch.commands.materials import materials
from gpsearch.commands.pick import pick_command
from gpsearch.commands.signals import Terminated
from gpsearch.commands.stability import stability
from gpsearch.commands.status import status
from gpsearch.commands.transfer import transfer_command
from gpsearch.errors import GpsearchError, StoreError
from workers import WorkersError


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="gpsearch")
def commands() -> None:
    """Finds the smallest, fastest analytic BRDF that reproduces measured materials in a scene."""


for command in (
    launch,
    status,
    export,
    judge,
    chart,
    chart_search,
    stability,
    pick_command,
    transfer_command,
    fit,
    materials,
):
    commands.add_command(command)


def main() -> None:
    """The console command `gpsearch`: errors of the packages become one message and an exit status."""
    try:
        commands(standalone_mode=False)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except StoreError as error:
        _complain(error)
        sys.exit(1)
    except (GpsearchError, FittersError) as error:
        _complain(error)
        sys.exit(2)
    except WorkersError as error:
        _complain(error)
        # A file that no worker can read is bad input all the same.
        sys.exit(2 if isinstance(error.__cause__, FittersError) else 1)
    except sqlite3.DatabaseError as error:
        _complain(f"the run's store cannot be read ({error}); restore it from a copy, or choose another --run")
        sys.exit(2)
    except Terminated:
        sys.exit(143)
    except (KeyboardInterrupt, click.Abort):
        click.echo("interrupted", err=True)
        sys.exit(130)
    except BrokenPipeError:
        # Whoever read our output has left, as `head` does.
        sys.stderr.close()
        sys.exit(1)


def _complain(error: Exception | str) -> None:
    click.echo(f"gpsearch: {error}", err=True)
