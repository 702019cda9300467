"""One connection to a Dask cluster: what is submitted goes out, what happens there comes in as events."""

from __future__ import annotations

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
class WorkerDied:
    """A worker left without notice."""

    worker: str


@dataclass(frozen=True)
class Workers:
    """The threads of the workers that are there, by address."""

    threads: dict[str, int]


@dataclass(frozen=True)
class Disconnected:
    """The scheduler is gone, and with it all that was submitted."""


Event = Began | Finished | Erred | ResultLost | WorkerDied | Workers | Disconnected


class Session:
    """What is submitted under a key is reported under it. `resources` are closed with the session."""

    def __init__(self, client: Client, resources: ExitStack) -> None:
        self.topic = f"gpsearch-{uuid4().hex}"
        self.client = client
        self._resources = resources
        assert client.loop is not None
        self._loop = client.loop
        self._events: SimpleQueue[Event] = SimpleQueue()
        self._futures: dict[str, Future] = {}
        self._answered = self._asked = monotonic()
        client.subscribe_topic(self.topic, self._task_began)
        client.subscribe_topic("all", self._cluster_changed)
        self._ask_for_workers()

    def submit(self, key: str, name: str, task: Task, workers: Iterable[str] | None) -> None:
        """Sends a task out; `name` groups keys on the dashboard, `workers` are those it may go to (None: any)."""
        where = None if workers is None else list(workers)
        future = self.client.submit(run_task, task, key=(name, int(key)), pure=False, workers=where)
        self._futures[key] = future
        future.add_done_callback(partial(self._task_ended, key))

    def cancel(self, keys: Iterable[str]) -> None:
        futures = [self._futures.pop(key) for key in keys if key in self._futures]
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

    def foreign_workers(self, ours: str) -> dict[str, str]:
        """What is wrong with the package of workers that hold another one than ours, by address."""
        return versions(self.client, ours)

    def close(self) -> None:
        self._futures.clear()
        self._resources.close()

    # on the main thread

    def _keep_in_touch(self) -> None:
        now = monotonic()
        if now - self._answered > SILENT_SECONDS:
            self._events.put(Disconnected())
        elif now - self._asked > REFRESH_SECONDS:
            self._ask_for_workers()

    def _ask_for_workers(self) -> None:
        self._asked = monotonic()
        self._loop.add_callback(self._list_workers)

    # on the client's event loop and callback threads

    async def _list_workers(self) -> None:
        try:
            threads = await self.client.scheduler.ncores()  # type: ignore[union-attr]
        except Exception:
            self._events.put(Disconnected())
        else:
            self._answered = monotonic()
            self._events.put(Workers(dict(threads)))

    async def _cancel(self, futures: list[Future]) -> None:
        with suppress(Exception):
            await self.client.cancel(futures, asynchronous=True)

    def _task_began(self, event: tuple[float, dict[str, str]]) -> None:
        self._events.put(Began(event[1]["began"], event[1]["worker"]))

    def _cluster_changed(self, event: tuple[float, Any]) -> None:
        change = event[1]
        if not isinstance(change, dict) or "worker" not in change:
            return
        if change.get("action") == "remove-worker" and not change.get("expected"):
            self._events.put(WorkerDied(change["worker"]))
        if change.get("action") in ("add-worker", "remove-worker"):
            self._loop.add_callback(self._list_workers)

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
            self._events.put(ResultLost(key))

    async def _fetch(self, key: str, future: Future) -> None:
        try:
            report = await self.client.gather(future, asynchronous=True)
        except Exception:
            self._events.put(ResultLost(key))
        else:
            self._events.put(Finished(key, report))
        self._futures.pop(key, None)

    async def _fetch_error(self, key: str, future: Future) -> None:
        error = await future.exception(asynchronous=True)
        self._events.put(Erred(key, error))
        self._futures.pop(key, None)
