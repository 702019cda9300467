"""Where the work runs: one process, or a Dask cluster whose processes keep their heavy data loaded."""

from workers.context import Recipe
from workers.errors import WorkersError
from workers.executor import Executor, open_executor
from workers.jobs import Done, Failure, Incident, Job
from workers.lanes import Lane, Stopped, run_lanes
from workers.settings import DaskSettings, LocalSettings, Settings
from workers.tls import Tls

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
    "Tls",
    "WorkersError",
    "open_executor",
    "run_lanes",
]
