"""Where the work runs: one process, or a Dask cluster whose processes keep their heavy data loaded."""

from workers.context import Recipe
from workers.errors import WorkersError
from workers.executor import DaskSettings, Executor, LocalSettings, Settings, open_executor

__all__ = [
    "DaskSettings",
    "Executor",
    "LocalSettings",
    "Recipe",
    "Settings",
    "WorkersError",
    "open_executor",
]
