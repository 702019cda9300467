"""One connection to a Dask cluster: tasks go out, and what happens there comes in as events."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any
from uuid import uuid4

from distributed import Client, Future, KilledWorker

from fitters.errors import FittersError
from workers.context import Raised
from workers.dask.connection import Package, faults_of_workers
from workers.dask.task import Report, Task, VersionDiffersError, run_task
from workers.dispatch.events import (
    Began,
    Disconnected,
    Dropped,
    Erred,
    Event,
    Finished,
    ResultLost,
    VersionsDiffer,
    WorkerLeft,
    WorkersListed,
)
from workers.errors import error_text

REFRESH_SECONDS = 2.0
"""How often the cluster is asked for its workers."""

SILENT_SECONDS = 60.0
"""A scheduler that does not answer for this time counts as disconnected."""

FETCH_SECONDS = 15.0
"""A result that does not arrive within this time counts as lost with its worker."""

CLOSE_SECONDS = 3.0
"""How long a client may take to say goodbye to a scheduler that may not be there."""


class Session:
    """A task that is submitted under a key is reported under it. `resources` are closed with the session."""

    resources: ExitStack

    def __init__(self, client: Client, package: Package | None, workers: Iterable[str]) -> None:
        """Workers must have our version of `package`; `workers` were asked already."""
        self._package, self._known = package, set(workers)
        self.topic = f"workers-{uuid4().hex}"
        self.client = client
        self.resources = ExitStack()
        assert client.loop is not None
        self._loop = client.loop
        self._queue: SimpleQueue[tuple[Callable[[float], Event], Any]] = SimpleQueue()
        self._futures: dict[int, Future] = {}
        self._comm = client.scheduler_comm
        self._changed = True
        self._answered = monotonic()
        self._asked: float | None = None
        client.subscribe_topic(self.topic, self._task_began)
        client.subscribe_topic("all", self._cluster_changed)

    @property
    def lost(self) -> bool:
        """Whether the connection broke; that the client makes another one by itself brings nothing back."""
        return self.client.scheduler_comm is not self._comm

    def submit(self, key: int, name: str, task: Task, workers: Sequence[str] | None) -> None:
        """Sends a task out; `name` groups keys on the dashboard, `workers` are to run it while one is there."""
        future = self.client.submit(
            run_task,
            task,
            key=(name, key),
            pure=False,
            workers=None if workers is None else list(workers),
            allow_other_workers=workers is not None,
        )
        self._futures[key] = future
        future.add_done_callback(partial(self._task_ended, key))

    def cancel(self, keys: Iterable[int]) -> None:
        futures = [future for key in keys if (future := self._futures.pop(key, None)) is not None]
        if futures:
            # What has failed may be the very connection that a cancellation needs.
            with suppress(Exception):
                self._loop.add_callback(partial(self._cancel, futures))

    def events(self, seconds: float) -> Iterator[tuple[Event, Any]]:
        """All events that are there, after waiting at most `seconds` for a first one.

        With `Finished` come the task's results, with `Dropped` and `Erred` the exception, with others nothing.
        """
        self._keep_in_touch()
        with suppress(Empty):
            event, payload = self._queue.get(timeout=max(seconds, 0.0))
            # An event has the time when it is read: nothing is late only because this process was busy.
            yield event(monotonic()), payload
            for _ in range(self._queue.qsize()):
                event, payload = self._queue.get_nowait()
                yield event(monotonic()), payload

    def close(self) -> None:
        self._futures.clear()
        with suppress(Exception):
            self.client.close(CLOSE_SECONDS)
        self.resources.close()

    # on the main thread

    def _keep_in_touch(self) -> None:
        now = monotonic()
        if self.lost:
            self._put(Disconnected)
        elif self._asked is not None:
            if now - self._asked > SILENT_SECONDS:
                self._put(Disconnected)
        elif self._changed or now - self._answered > REFRESH_SECONDS:
            self._asked, self._changed = now, False
            self._loop.add_callback(self._list_workers)

    # on the client's event loop and callback threads

    def _put(self, event: Callable[[float], Event], payload: Any = None) -> None:
        self._queue.put((event, payload))

    async def _list_workers(self) -> None:
        try:
            threads = dict(await self.client.scheduler.ncores())  # type: ignore[union-attr]
        except Exception:
            self._put(Disconnected)
            return
        self._answered, self._asked = monotonic(), None
        self._put(lambda now: WorkersListed(now, threads))
        new = threads.keys() - self._known
        self._known = set(threads)
        if new:
            with suppress(Exception):
                faults = await faults_of_workers(self.client, self._package, list(new))
                if faults:
                    self._put(lambda now: VersionsDiffer(now, faults))

    async def _cancel(self, futures: list[Future]) -> None:
        with suppress(Exception):
            await self.client.cancel(futures, asynchronous=True)

    def _task_began(self, event: tuple[float, dict[str, Any]]) -> None:
        key, worker = event[1]["began"], event[1]["worker"]
        self._put(lambda now: Began(now, key, worker))

    def _cluster_changed(self, event: tuple[float, Any]) -> None:
        change = event[1]
        if not isinstance(change, dict) or "worker" not in change:
            return
        if change.get("action") == "remove-worker":
            names = [key for key in change["processing-tasks"] if isinstance(key, tuple) and len(key) == 2]
            keys = [key for _, key in names if isinstance(key, int)]
            worker, died = change["worker"], not change["expected"]
            self._put(lambda now: WorkerLeft(now, worker, keys, died))
        self._changed |= change.get("action") in ("add-worker", "remove-worker")

    def _task_ended(self, key: int, future: Future) -> None:
        if self._futures.get(key) is not future:
            return
        if future.status == "finished":
            self._loop.add_callback(partial(self._fetch, key, future))
        elif future.status == "error":
            self._loop.add_callback(partial(self._fetch_error, key, future))
        elif future.status == "cancelled":
            self._put(Disconnected)
        else:
            self.cancel([key])
            self._put(lambda now: ResultLost(now, key))

    async def _fetch(self, key: int, future: Future) -> None:
        results: list[Any] | None = None
        try:
            report: Report = await asyncio.wait_for(self.client.gather(future, asynchronous=True), FETCH_SECONDS)
            raised = [(i, result.text) for i, result in enumerate(report.results) if isinstance(result, Raised)]
            results, seconds = report.results, report.seconds
        except (Exception, asyncio.CancelledError):
            pass
        self._futures.pop(key, None)
        if results is None:
            self._put(lambda now: ResultLost(now, key))
        else:
            self._put(lambda now: Finished(now, key, seconds, raised), results)

    async def _fetch_error(self, key: int, future: Future) -> None:
        try:
            error = await future.exception(asynchronous=True)
        except Exception as failure:
            error = failure
        self._futures.pop(key, None)
        if isinstance(error, KilledWorker):
            worker = error.last_worker.address
            self._put(lambda now: Dropped(now, key, worker), error)
            return
        bad_input, faults = isinstance(error, FittersError), {}
        if isinstance(error, VersionDiffersError):
            faults = dict([error.args])
        elif not bad_input:
            # A worker with another version may not even understand a task.
            with suppress(Exception):
                faults = await faults_of_workers(self.client, self._package)
        where = next(iter(getattr(error, "__notes__", ())), "a worker")
        self._put(lambda now: Erred(now, key, error_text(error), where, bad_input, faults), error)
