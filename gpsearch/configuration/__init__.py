"""The configuration of a run: read from YAML, validated once, complete with every default."""

from gpsearch.configuration.loading import load_configuration, parse_configuration
from gpsearch.configuration.model import Configuration, Difference
from gpsearch.configuration.sections import (
    BudgetSection,
    DaskExecutorSection,
    EditsSection,
    FitSection,
    LocalExecutorSection,
    SceneSection,
    SearchSection,
)

__all__ = [
    "BudgetSection",
    "Configuration",
    "DaskExecutorSection",
    "Difference",
    "EditsSection",
    "FitSection",
    "LocalExecutorSection",
    "SceneSection",
    "SearchSection",
    "load_configuration",
    "parse_configuration",
]
