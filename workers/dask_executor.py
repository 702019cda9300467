"""The executor that sends tasks to Dask workers; only recipes, payloads and results travel."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import Any, TypeVar
from uuid import uuid4

from distributed import CancelledError, Client, Future, KilledWorker, as_completed, get_worker
from distributed.scheduler import NoValidWorkerError, NoWorkerError

from workers.context import Recipe, context_of
from workers.dask_connection import connect, require_same_package
from workers.errors import WorkersError, task_failed
from workers.processes import start_processes

P = TypeVar("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Task:
    """All that travels to a worker."""

    function: Callable[[Any, Any], Any]
    recipe: Recipe
    payload: Any


def run_task(task: Task) -> Any:
    """The task's result, computed in a worker; what the function raises carries the worker as a note."""
    try:
        return task.function(context_of(task.recipe), task.payload)
    except Exception as error:
        error.add_note(f"worker {get_worker().address}")
        raise


class DaskExecutor:
    """Runs tasks on the workers of a client; `open_dask` makes one."""

    def __init__(self, client: Client, description: str, resources: ExitStack) -> None:
        """`description` says where the workers are; `resources` closes the client and what it came with."""
        self.description = description
        self._client = client
        self._resources = resources

    @property
    def processes(self) -> int:
        """The threads of all workers that are there now, at least 1."""
        try:
            return max(1, sum(self._client.nthreads().values()))
        except OSError as error:
            raise WorkersError(f"lost the connection to {self.description}: {error}") from error

    def run(
        self, function: Callable[[Any, P], R], recipe: Recipe, payloads: Iterable[P], *, label: str
    ) -> Iterator[tuple[int, R]]:
        """See `Executor.run`."""
        name = f"{key_prefix(label)}-{uuid4().hex}"
        outstanding: dict[Future, int] = {}
        try:
            for index, payload in enumerate(payloads):
                task = Task(function, recipe, payload)
                outstanding[self._client.submit(run_task, task, key=(name, index), pure=False)] = index
            for batch in as_completed(list(outstanding), loop=self._client.loop).batches():
                for future, result in zip(batch, self._results(batch, outstanding, label), strict=True):
                    index = outstanding.pop(future)
                    future.release()
                    yield index, result
        except (OSError, CancelledError) as error:
            raise WorkersError(
                f"{label}: lost the connection to {self.description} with {len(outstanding)} tasks outstanding: "
                "see whether the scheduler still runs, then start again"
            ) from error
        finally:
            # What failed may be the very connection that a cancellation needs.
            with suppress(Exception):
                self._client.cancel(list(outstanding))

    def _results(self, batch: list[Future], indices: dict[Future, int], label: str) -> list[Any]:
        for future in batch:
            if future.status == "error":
                raise _failure(label, indices[future], future.exception())
        return self._client.gather(batch)

    def close(self) -> None:
        """Closes the client, and the processes where we started them."""
        self._resources.close()


def open_dask(scheduler: str | None, workers: int | None, wait_seconds: float) -> DaskExecutor:
    """An executor on the scheduler at that address, or, for None, on fresh processes of this machine.

    Raises `WorkersError` where that fails within `wait_seconds` or another gpsearch is installed there.
    """
    with ExitStack() as resources:
        if scheduler is None:
            client = start_processes(workers, wait_seconds, resources)
        else:
            client = connect(scheduler, wait_seconds, resources)
        require_same_package(client)
        count = len(client.nthreads())
        if scheduler is None:
            description = f"{count} worker process{'es' * (count != 1)} on this machine"
        else:
            description = f"{scheduler} with {count} worker{'s' * (count != 1)}"
        kept = resources.pop_all()
    return DaskExecutor(client, description, kept)


def key_prefix(label: str) -> str:
    """`label` as the start of a task key: letters, digits and dashes, a letter first.

    Dask's dashboard groups tasks by the key's leading dash-separated words that hold letters only
    (`dask.utils.key_split`): `fit-island2-generation7` counts as `fit`. Since a scheduler remembers every
    such prefix for ever, put what varies after them.
    """
    key = re.sub(r"[^A-Za-z0-9]+", "-", label).strip("-")
    return key if key[:1].isalpha() else f"task-{key}"


def _failure(label: str, index: int, error: BaseException) -> WorkersError:
    if isinstance(error, KilledWorker):
        failure = WorkersError(
            f"{label}: task {index} was given up after {error.allowed_failures + 1} worker processes died "
            f"running it, the last at {error.last_worker.address}: see its log; memory is the usual reason"
        )
    elif isinstance(error, (NoValidWorkerError, NoWorkerError)):
        failure = WorkersError(f"{label}: task {index} found no worker any more: start some, then start again")
    else:
        where = next(iter(getattr(error, "__notes__", ())), "a worker")
        failure = task_failed(label, index, error, where)
    failure.__cause__ = error
    return failure
