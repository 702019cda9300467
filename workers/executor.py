"""Executors: the one interface to running a function over items, wherever that is, and their registry."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import ClassVar, Protocol

from workers.dask.settings import DaskSettings
from workers.jobs import Done, Incident, Job
from workers.local import LocalSettings


class Executor(Protocol):
    """Runs pure functions in processes that keep their heavy data loaded. `ExecutorContract` tests one."""

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
        """New results, in any order, each item once; waits about `seconds` for a first one.

        An item that raises, crashes or hangs wherever it is computed has a `Failure` for a result. Raises
        `WorkersError` where the work cannot go on: bad input, no scheduler or no worker for too long.
        """

    def abandon(self) -> None:
        """Gives up what is outstanding."""

    def incidents(self) -> list[Incident]:
        """What has happened to the cluster since the last call."""

    def close(self) -> None:
        """Ends or leaves the processes; nothing can be run afterwards."""


class ExecutorSettings(Protocol):
    """A kind of executor: a frozen dataclass of its options, all with defaults. `kind` is its name."""

    kind: ClassVar[str]

    def open(self, package: str | None) -> Executor:
        """An executor that is ready to run: see `open_executor`. What is slow to import is imported here."""


EXECUTORS: dict[str, type[ExecutorSettings]] = {
    settings.kind: settings
    for settings in (
        LocalSettings,
        DaskSettings,
    )
}
"""Every kind of executor by its name. To add one, write its settings and add a line."""


@contextmanager
def open_executor(settings: ExecutorSettings, package: str | None = None) -> Iterator[Executor]:
    """The executor that `settings` describe, ready to run and closed at the end.

    `package` is a distribution whose version must be the same wherever the work runs; None where any will do.
    Raises `WorkersError` where no scheduler or worker is there in time, or none has our version of the package.
    """
    executor = settings.open(package)
    try:
        yield executor
    finally:
        executor.close()
