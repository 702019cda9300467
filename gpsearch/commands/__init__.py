"""The command line: `gpsearch launch | status | export | fit | materials`."""

from gpsearch.commands.main import main

__all__ = ["main"]
