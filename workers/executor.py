"""Executors: the one interface to running a function over payloads, wherever the processes are."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from workers.context import Recipe
from workers.local import LocalExecutor

P = TypeVar("P")
R = TypeVar("R")


class Executor(Protocol):
    """Runs pure functions in processes that keep their heavy data loaded."""

    @property
    def description(self) -> str:
        """Where the work runs, in words: "this process", "tcp://host:8786 with 5 workers"."""

    @property
    def processes(self) -> int:
        """How many tasks run at once now, at least 1."""

    def run(
        self, function: Callable[[Any, P], R], recipe: Recipe, payloads: Iterable[P], *, label: str
    ) -> Iterator[tuple[int, R]]:
        """Yields (index, function(context, payload)) as they complete, each index once.

        `context` is what `recipe` builds in the process that runs the task. Work starts with the first `next`, on
        a cluster while `payloads` is still being drawn from; closing the iterator gives up what is outstanding.
        `label` names the work in messages and on the dashboard. Raises `WorkersError` where the function raises
        or the work cannot go on.
        """

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
    """How long to wait, in all, for the scheduler and a first worker.

    Processes of this machine may also be gone for so long before a run fails. A running cluster that loses all
    its workers waits for new ones, unless its scheduler's own `no-workers-timeout` says otherwise.
    """


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

            executor = open_dask(settings.scheduler, settings.workers, settings.wait_seconds)
    try:
        yield executor
    finally:
        executor.close()
