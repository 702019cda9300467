"""Which formulas to try, and what was found: configuration, genomes, evolution, front, exports."""

from importlib.metadata import version

__version__ = version("gpsearch")
