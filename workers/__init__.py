"""Where the work runs: one process, or a Dask cluster whose processes keep their heavy data loaded."""

from workers.context import Recipe
from workers.dask.settings import DaskSettings
from workers.dask.tls import Tls
from workers.errors import WorkersError
from workers.executor import EXECUTORS, Executor, ExecutorSettings, open_executor
from workers.jobs import Done, Failure, Incident, Job
from workers.lanes import Lane, Stopped, run_lanes
from workers.local import LocalSettings

__all__ = [
    "EXECUTORS",
    "DaskSettings",
    "Done",
    "Executor",
    "ExecutorSettings",
    "Failure",
    "Incident",
    "Job",
    "Lane",
    "LocalSettings",
    "Recipe",
    "Stopped",
    "Tls",
    "WorkersError",
    "open_executor",
    "run_lanes",
]
