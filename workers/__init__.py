"""Where the work runs: one process, or a Dask cluster whose processes keep their heavy data loaded."""

from workers.context import Recipe
from workers.errors import WorkersError
from workers.executor import DaskSettings, Executor, LocalSettings, Settings, open_executor
from workers.jobs import Done, Failure, Incident, Job
from workers.lanes import Lane, Stopped, run_lanes

__all__ = [
    "DaskSettings",
    "Done",
    "Executor",
    "Failure",
    "Incident",
    "Job",
    "Lane",
    "LocalSettings",
    "Recipe",
    "Settings",
    "Stopped",
    "WorkersError",
    "open_executor",
    "run_lanes",
]
