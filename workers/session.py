"""One connection to a Dask cluster: what is submitted goes out, what happens there comes in as events."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any
from uuid import uuid4

from distributed import Client, Future

from workers.dask_connection import versions
from workers.task import Report, Task, run_task

REFRESH_SECONDS = 2.0
"""How often the cluster is asked for its workers."""

SILENT_SECONDS = 60.0
"""A scheduler that does not answer for so long is taken for lost."""

FETCH_SECONDS = 15.0
"""A result that does not come for so long is taken for lost with its worker."""

CLOSE_SECONDS = 3.0
"""How long a client may take to say goodbye to a scheduler that may not be there."""


@dataclass(frozen=True)
class Began:
    """A task is under way at a worker."""

    key: str
    worker: str


@dataclass(frozen=True)
class Finished:
    """A task's report is here."""

    key: str
    report: Report


@dataclass(frozen=True)
class Erred:
    """A task raised, or the cluster gave it up."""

    key: str
    error: BaseException


@dataclass(frozen=True)
class ResultLost:
    """A task had finished, but its report went with its worker."""

    key: str


@dataclass(frozen=True)
class WorkerLeft:
    """A worker left, with these keys; `died`: without notice."""

    worker: str
    keys: list[str]
    died: bool


@dataclass(frozen=True)
class Workers:
    """The threads of the workers that are there, by address."""

    threads: dict[str, int]


@dataclass(frozen=True)
class Foreign:
    """Workers that hold another package than ours, and what is wrong with it, by address."""

    faults: dict[str, str]


@dataclass(frozen=True)
class Disconnected:
    """The scheduler is gone, and with it all that was submitted."""


Event = Began | Finished | Erred | ResultLost | WorkerLeft | Workers | Foreign | Disconnected


class Session:
    """What is submitted under a key is reported under it. `resources` are closed with the session."""

    resources: ExitStack

    def __init__(self, client: Client, version: str, workers: Iterable[str]) -> None:
        """Workers must have that `version` of our package; `workers` were asked already."""
        self._version, self._known = version, set(workers)
        self.topic = f"gpsearch-{uuid4().hex}"
        self.client = client
        self.resources = ExitStack()
        assert client.loop is not None
        self._loop = client.loop
        self._events: SimpleQueue[Event] = SimpleQueue()
        self._futures: dict[str, Future] = {}
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

    def submit(self, key: str, name: str, task: Task, workers: Iterable[str] | None) -> None:
        """Sends a task out; `name` groups keys on the dashboard, `workers` are to do it while one is there."""
        where = None if workers is None else list(workers)
        future = self.client.submit(
            run_task, task, key=(name, int(key)), pure=False, workers=where, allow_other_workers=where is not None
        )
        self._futures[key] = future
        future.add_done_callback(partial(self._task_ended, key))

    def cancel(self, keys: Iterable[str]) -> None:
        futures = [future for key in keys if (future := self._futures.pop(key, None)) is not None]
        if futures:
            # What has failed may be the very connection that a cancellation needs.
            with suppress(Exception):
                self._loop.add_callback(partial(self._cancel, futures))

    def events(self, seconds: float) -> list[Event]:
        """All events that are there; waits so long for a first one."""
        self._keep_in_touch()
        found: list[Event] = []
        with suppress(Empty):
            found.append(self._events.get(timeout=max(seconds, 0.0)))
            while True:
                found.append(self._events.get_nowait())
        return found

    def foreign_workers(self) -> dict[str, str]:
        """What is wrong with the package of workers that hold another one than ours, by address, asked now."""
        return self.client.sync(versions, self.client, self._version)

    def close(self) -> None:
        self._futures.clear()
        with suppress(Exception):
            self.client.close(CLOSE_SECONDS)
        self.resources.close()

    # on the main thread

    def _keep_in_touch(self) -> None:
        now = monotonic()
        if self.lost:
            self._events.put(Disconnected())
        elif self._asked is not None:
            if now - self._asked > SILENT_SECONDS:
                self._events.put(Disconnected())
        elif self._changed or now - self._answered > REFRESH_SECONDS:
            self._asked, self._changed = now, False
            self._loop.add_callback(self._list_workers)

    # on the client's event loop and callback threads

    async def _list_workers(self) -> None:
        try:
            threads = await self.client.scheduler.ncores()  # type: ignore[union-attr]
        except Exception:
            self._events.put(Disconnected())
            return
        self._answered, self._asked = monotonic(), None
        self._events.put(Workers(dict(threads)))
        new = threads.keys() - self._known
        self._known = set(threads)
        if new:
            with suppress(Exception):
                self._events.put(Foreign(await versions(self.client, self._version, list(new))))

    async def _cancel(self, futures: list[Future]) -> None:
        with suppress(Exception):
            await self.client.cancel(futures, asynchronous=True)

    def _task_began(self, event: tuple[float, dict[str, str]]) -> None:
        self._events.put(Began(event[1]["began"], event[1]["worker"]))

    def _cluster_changed(self, event: tuple[float, Any]) -> None:
        change = event[1]
        if not isinstance(change, dict) or "worker" not in change:
            return
        if change.get("action") == "remove-worker":
            keys = [str(key[1]) for key in change["processing-tasks"] if isinstance(key, tuple) and len(key) == 2]
            self._events.put(WorkerLeft(change["worker"], keys, died=not change["expected"]))
        self._changed |= change.get("action") in ("add-worker", "remove-worker")

    def _task_ended(self, key: str, future: Future) -> None:
        if self._futures.get(key) is not future:
            return
        if future.status == "finished":
            self._loop.add_callback(partial(self._fetch, key, future))
        elif future.status == "error":
            self._loop.add_callback(partial(self._fetch_error, key, future))
        elif future.status == "cancelled":
            self._events.put(Disconnected())
        else:
            self.cancel([key])
            self._events.put(ResultLost(key))

    async def _fetch(self, key: str, future: Future) -> None:
        event: Event
        try:
            report = await asyncio.wait_for(self.client.gather(future, asynchronous=True), FETCH_SECONDS)
            event = Finished(key, report)
        except (Exception, asyncio.CancelledError):
            event = ResultLost(key)
        self._futures.pop(key, None)
        self._events.put(event)

    async def _fetch_error(self, key: str, future: Future) -> None:
        try:
            error = await future.exception(asynchronous=True)
        except Exception as failure:
            error = failure
        self._futures.pop(key, None)
        self._events.put(Erred(key, error))
