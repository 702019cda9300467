"""The configuration of a run: read from YAML, validated once, complete with every default."""

from gpsearch.configuration.comparison import Difference
from gpsearch.configuration.loading import load_configuration, parse_configuration
from gpsearch.configuration.model import Configuration
from gpsearch.configuration.sections import (
    Budget,
    DaskExecutor,
    EditFrequencies,
    FitSection,
    LocalExecutor,
    SceneSection,
    Search,
)

__all__ = [
    "Budget",
    "Configuration",
    "DaskExecutor",
    "Difference",
    "EditFrequencies",
    "FitSection",
    "LocalExecutor",
    "SceneSection",
    "Search",
    "load_configuration",
    "parse_configuration",
]
