"""The command line: `gpsearch launch | status | export | chart | fit | materials`."""

from gpsearch.commands.group import main

__all__ = ["main"]
