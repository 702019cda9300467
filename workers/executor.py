"""Executors: the one interface to running a function over payloads, wherever the processes are."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from workers.jobs import Done, Incident, Job
from workers.local import LocalExecutor


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


@dataclass(frozen=True)
class LocalSettings:
    """Run in this process, one task after the other."""


@dataclass(frozen=True)
class DaskSettings:
    """Run on a Dask cluster: a running one, or worker processes of this machine."""

    scheduler: str | None = None
    """`tcp://HOST:PORT` of a running scheduler; None starts worker processes on this machine."""
    workers: int | None = None
    """How many processes to start where `scheduler` is None; None is one per core."""
    wait_seconds: float = 60.0
    """How long to wait for the scheduler and a first worker; they may be away for so long later on, too."""
    hang_seconds: float = 60.0
    """What takes longer than this, and 30 times what it should, is taken to hang."""


Settings = LocalSettings | DaskSettings


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

            executor = open_dask(
                settings.scheduler, settings.workers, settings.wait_seconds, settings.hang_seconds
            )
    try:
        yield executor
    finally:
        executor.close()
