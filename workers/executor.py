"""Executors: the one interface to running a function over items, wherever the processes are."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from workers.jobs import Done, Incident, Job
from workers.local import LocalExecutor
from workers.settings import DaskSettings, LocalSettings, Settings


class Executor(Protocol):
    """Runs pure functions in processes that keep their heavy data loaded."""

    @property
    def description(self) -> str:
        """Where the work runs, in words: "this process", "tcp://host:8786 with 5 workers"."""

    @property
    def processes(self) -> int:
        """How many tasks run at once now, at least 1."""

    @property
    def outstanding(self) -> int:
        """How many items were asked for and have no result yet."""

    def submit(self, job: Job) -> None:
        """Asks for the items of a job, after those that were asked for before."""

    def wait(self, seconds: float) -> list[Done]:
        """Results that have come in since, in any order, each item once; waits about so long for a first one.

        An item that raises, crashes or hangs wherever it is computed has a `Failure` for a result. Raises
        `WorkersError` where the work cannot go on: bad input, no scheduler or no worker for too long.
        """

    def abandon(self) -> None:
        """Gives up what is outstanding."""

    def incidents(self) -> list[Incident]:
        """What has happened to the cluster since this was last asked for."""

    def close(self) -> None:
        """Lets go of the processes; nothing can be run afterwards."""


@contextmanager
def open_executor(settings: Settings) -> Iterator[Executor]:
    """The executor that `settings` describe, ready to run and closed at the end.

    Raises `WorkersError` where no scheduler or worker is there in time, or its gpsearch differs from ours.
    """
    executor: Executor
    match settings:
        case LocalSettings():
            executor = LocalExecutor()
        case DaskSettings():
            # distributed takes most of a second to import, which a run in this process need not pay.
            from workers.dask_executor import open_dask

            executor = open_dask(settings)
    try:
        yield executor
    finally:
        executor.close()
