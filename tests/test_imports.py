"""What is imported when: the command line answers before the heavy libraries are there."""

import subprocess
import sys

import click
import pytest

from gpsearch.commands.main import COMMANDS, commands

HEAVY = ("numpy", "numba", "scipy", "dask", "distributed", "sympy", "matplotlib", "plotly", "pydantic", "skimage")


def imported_by(*arguments: str) -> set[str]:
    """Of the heavy libraries, those that `gpsearch` with these arguments imports, in a process of its own."""
    code = (
        "import atexit, sys; from gpsearch.commands import main;"
        "atexit.register(lambda: print('imported', *sys.modules, file=sys.stderr)); main()"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=60, check=True
    )
    modules = result.stderr.splitlines()[-1].split()
    assert "gpsearch.commands.main" in modules
    return set(HEAVY) & set(modules)


@pytest.mark.parametrize("arguments", [("--version",), ("--help",), ("-h",)])
def test_the_command_line_answers_without_heavy_libraries(arguments):
    assert imported_by(*arguments) == set()


@pytest.mark.parametrize("command", ["status", "export", "materials"])
def test_a_command_that_draws_nothing_imports_no_library_for_pictures(command):
    assert imported_by(command, "--help") & {"matplotlib", "plotly", "dask", "distributed", "sympy"} == set()


@pytest.mark.parametrize("name", COMMANDS)
def test_every_listed_command_is_there_under_its_name(name):
    command = commands.get_command(click.Context(commands), name)
    assert command is not None
    assert (command.name, bool(command.help)) == (name, True)


def test_a_command_that_is_not_there_is_refused():
    with pytest.raises(click.UsageError, match="No such command 'nothing'"):
        commands.main(["nothing"], standalone_mode=False)
