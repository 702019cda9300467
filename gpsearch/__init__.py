"""Searches formulas of reflectance: which ones to try, and what a run found.

    result = gpsearch.load_run("runs/metals")
    result.formulas[-1].expression, result.baselines, result.model("ggx", "steel")

Names are loaded when they are first used: the import itself costs nothing.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from gpsearch.errors import GpsearchError

if TYPE_CHECKING:
    from gpsearch.run import Baseline, FoundFormula, Result, load_run

__all__ = ["Baseline", "FoundFormula", "GpsearchError", "Result", "__version__", "load_run"]

__version__ = version("gpsearch")


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module("gpsearch.run"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
