"""The executor that sends tasks to Dask workers; only recipes, items and results travel.

What goes out when is decided by `Dispatch`, what travels is a `Task`, and a `Session` is one connection: where the
scheduler goes away, everything outstanding goes out again through the next one.
"""

from __future__ import annotations

import importlib.metadata
import re
from collections.abc import Callable
from contextlib import ExitStack, suppress
from time import monotonic, sleep
from uuid import uuid4
from weakref import WeakKeyDictionary

from distributed import Client, KilledWorker

from fitters.errors import FittersError
from workers.dask_connection import PACKAGE, connect, fault, require_same_package
from workers.dispatch import Batch, Dispatch, Submission
from workers.errors import WorkersError, task_failed
from workers.jobs import Done, Incident, Job
from workers.processes import start_processes
from workers.session import (
    Began,
    Disconnected,
    Erred,
    Event,
    Finished,
    Foreign,
    ResultLost,
    Session,
    WorkerLeft,
    Workers,
)
from workers.settings import DaskSettings
from workers.task import ForeignWorkerError, Task
from workers.terminal import silenced_logs

TICK = 0.25
"""Seconds after which what hangs or is late is looked for, where nothing happens."""

ATTEMPT_SECONDS = 2.0
"""Of one attempt to reach a scheduler that went away."""

Connect = Callable[[float, ExitStack], Client]
"""A client within so many seconds, or `WorkersError`; the stack closes it."""


class DaskExecutor:
    """Runs jobs on the workers of a cluster; `open_dask` makes one.

    place: says where the workers are, without their number
    """

    def __init__(
        self, reach: Connect, place: Callable[[int], str], wait_seconds: float, hang_seconds: float, *, again: bool
    ) -> None:
        """`again`: whether `reach` may be called again, where the scheduler has gone away."""
        self._reach, self._place, self._again = reach, place, again
        self._wait_seconds = wait_seconds
        self._dispatch = Dispatch(hang_seconds)
        self._version = importlib.metadata.version(PACKAGE)
        self._names: WeakKeyDictionary[Job, str] = WeakKeyDictionary()
        self._threads: dict[str, int] = {}
        self._refused: set[str] = set()
        self._incidents: list[Incident] = []
        self._without_since: float | None = None
        self._began = self._looked = monotonic()
        with ExitStack() as resources:
            resources.enter_context(silenced_logs())
            self._session: Session | None = self._connected(wait_seconds)
            self._resources = resources.pop_all()

    @property
    def description(self) -> str:
        return self._place(len(self._usable()))

    @property
    def processes(self) -> int:
        """The threads of all workers that are there now, at least 1."""
        return max(1, sum(self._usable().values()))

    @property
    def outstanding(self) -> int:
        return self._dispatch.outstanding

    def submit(self, job: Job) -> None:
        """See `Executor.submit`."""
        # A scheduler remembers the first word for ever, so that what varies comes after it.
        self._names[job] = f"{key_prefix(job.label)}-{uuid4().hex}"
        self._dispatch.add(job)
        self._send()

    def wait(self, seconds: float) -> list[Done]:
        """See `Executor.wait`."""
        deadline = monotonic() + seconds
        done: list[Done] = []
        while not done and self.outstanding:
            left = max(0.0, deadline - monotonic())
            if self._session is None:
                self._reconnect()
            else:
                for event in self._session.events(min(left, TICK)):
                    done += self._handled(event)
                    if self._session is None:
                        break
                if monotonic() - self._looked > TICK:
                    self._looked = monotonic()
                    done += self._dispatch.overdue(self._looked)
                self._require_workers()
            self._send()
            if not left:
                break
        return done

    def abandon(self) -> None:
        """See `Executor.abandon`."""
        self._dispatch.clear()
        self._names.clear()
        self._send()

    def incidents(self) -> list[Incident]:
        """See `Executor.incidents`."""
        if self._dispatch.retries:
            self._incidents.append(Incident("retry", str(self._dispatch.retries)))
            self._dispatch.retries = 0
        found, self._incidents = self._incidents, []
        return found

    def close(self) -> None:
        """Closes the client, and the processes where we started them."""
        with self._resources:
            if self._session is not None:
                self._session.close()

    # what goes out

    def _send(self) -> None:
        if self._session is None or self._session.lost:
            return
        if threads := sum(self._usable().values()):
            for submission in self._dispatch.submissions(threads, monotonic()):
                self._submit(submission)
        self._session.cancel(self._dispatch.cancelled)
        self._dispatch.cancelled.clear()

    def _submit(self, submission: Submission) -> None:
        assert self._session is not None
        batch, workers = submission.batch, None
        if self._refused or submission.avoid:
            workers = [address for address in self._usable() if address not in submission.avoid] or None
        task = Task(
            function=batch.job.function,
            recipe=batch.job.recipe,
            items=batch.items,
            key=submission.key,
            topic=self._session.topic,
            version=self._version,
            limit=batch.limit,
            suspect=batch.strikes > 0 or batch.doubted,
        )
        self._session.submit(submission.key, self._names[batch.job], task, workers)

    def _usable(self) -> dict[str, int]:
        return {address: n for address, n in self._threads.items() if address not in self._refused}

    # what comes in

    def _handled(self, event: Event) -> list[Done]:
        dispatch = self._dispatch
        match event:
            case Began(key, worker):
                self._began = monotonic()
                dispatch.began(key, worker, self._began)
            case Finished(key, report):
                return dispatch.finished(key, report.results, report.seconds)
            case ResultLost(key):
                dispatch.refused(key)
            case Erred(key, error):
                self._erred(key, error)
            case WorkerLeft(worker, keys, died):
                if died:
                    self._incidents.append(Incident("lost", worker))
                return dispatch.worker_left(worker, keys, died=died)
            case Workers(threads):
                self._note_workers(threads)
            case Foreign(faults):
                self._refuse(faults)
            case Disconnected():
                self._disconnected()
        return []

    def _erred(self, key: str, error: BaseException) -> None:
        """A whole task went wrong: not for one of its items, but for where it ran."""
        batch = self._dispatch.batch(key)
        if batch is None:
            return
        if isinstance(error, FittersError):
            raise _failure(batch, error)
        if isinstance(error, KilledWorker):
            in_vain = not self._dispatch.dropped(key)
            if in_vain and monotonic() - self._began > self._wait_seconds:
                raise WorkersError(
                    f"{batch.job.label}: for {self._wait_seconds:g} s worker processes have died before they could"
                    f" begin, the last at {error.last_worker.address}: see its log; materials that do not fit into"
                    " its memory are the usual reason"
                ) from error
            return
        if isinstance(error, ForeignWorkerError):
            self._refuse({error.address: fault(error.version, self._version)})
            self._dispatch.refused(key)
        elif self._refuse(self._foreign_workers()):
            self._dispatch.refused(key)
        elif not self._dispatch.erred(key):
            raise _failure(batch, error)

    def _foreign_workers(self) -> dict[str, str]:
        """None are known where the cluster cannot be asked; that it is lost is heard of soon enough."""
        try:
            return self._session.foreign_workers() if self._session else {}
        except Exception:
            return {}

    def _refuse(self, faults: dict[str, str]) -> bool:
        """Gives workers with another package no more work; whether any has one."""
        for address in sorted(faults.keys() - self._refused):
            self._incidents.append(Incident("refused", f"worker {address} {faults[address]}; it gets no work"))
        self._refused |= faults.keys()
        return bool(faults)

    def _note_workers(self, threads: dict[str, int]) -> None:
        joined, left = threads.keys() - self._threads.keys(), self._threads.keys() - threads.keys()
        if joined or left:
            changes = [f"{len(joined)} joined"] * bool(joined) + [f"{len(left)} left"] * bool(left)
            self._incidents.append(Incident("workers", ", ".join([*changes, f"{len(threads)} there"])))
        self._threads = threads
        self._refused &= threads.keys()
        self._without_since = None if self._usable() else self._without_since or monotonic()

    def _require_workers(self) -> None:
        """Raises where no worker has been there for longer than a run waits."""
        if self._without_since is not None and monotonic() - self._without_since > self._wait_seconds:
            raise WorkersError(
                f"{self._place(0)} for {self._wait_seconds:g} s, with {self.outstanding} pieces of work"
                " outstanding: start some, then start again; what was stored is kept"
            )

    # the connection

    def _connected(self, seconds: float) -> Session:
        with ExitStack() as resources:
            client = self._reach(seconds, resources)
            self._refused.clear()
            self._refuse(require_same_package(client, self._version))
            self._threads = dict(client.nthreads())
            self._without_since = None
            session = Session(client, self._version, self._threads)
            session.resources = resources.pop_all()
            return session

    def _disconnected(self) -> None:
        """All that was out will go out again, through another connection."""
        if self._session is None:
            return
        with suppress(Exception):
            self._session.close()
        self._session = None
        self._dispatch.scheduler_lost()
        self._without_since = monotonic()
        self._incidents.append(Incident("scheduler", f"lost the connection to {self._place(len(self._threads))}"))

    def _reconnect(self) -> None:
        """One attempt. Raises `WorkersError` where the scheduler has been away for longer than a run waits."""
        assert self._without_since is not None
        since = self._without_since
        try:
            if not self._again:
                raise WorkersError("its scheduler was part of this process")
            self._session = self._connected(ATTEMPT_SECONDS)
        except Exception as error:
            # A scheduler that has just come back may go away in the middle of anything.
            self._without_since = since
            if not self._again or monotonic() - since > self._wait_seconds:
                raise WorkersError(
                    f"lost the connection to {self._place(len(self._threads))} with {self.outstanding} pieces of"
                    f" work outstanding: {error}; what was stored is kept"
                ) from error
            sleep(TICK)
            return
        back = f"back after {monotonic() - since:.0f} s: {self.description}"
        self._incidents.append(Incident("scheduler", back))


def open_dask(settings: DaskSettings) -> DaskExecutor:
    """An executor on a running scheduler, or on fresh processes of this machine.

    Raises `WorkersError` where that fails within `wait_seconds` or another gpsearch is installed there.
    """
    scheduler = settings.scheduler

    def reach(seconds: float, resources: ExitStack) -> Client:
        if scheduler is None:
            return start_processes(settings.workers, seconds, resources)
        return connect(scheduler, seconds, resources, settings.tls)

    def place(count: int) -> str:
        if scheduler is None:
            return f"{count or 'no'} worker process{'es' * (count != 1)} on this machine"
        return f"{scheduler} with {count or 'no'} worker{'s' * (count != 1)}"

    return DaskExecutor(reach, place, settings.wait_seconds, settings.hang_seconds, again=scheduler is not None)


def key_prefix(label: str) -> str:
    """`label` as the start of a task key: letters, digits and dashes, a letter first.

    Dask's dashboard groups tasks by the key's leading dash-separated words that hold letters only
    (`dask.utils.key_split`): `screen-island2-generation7` counts as `screen`. Since a scheduler remembers every
    such prefix for ever, put what varies after them.
    """
    key = re.sub(r"[^A-Za-z0-9]+", "-", label).strip("-")
    return key if key[:1].isalpha() else f"task-{key}"


def _failure(batch: Batch, error: BaseException) -> WorkersError:
    where = next(iter(getattr(error, "__notes__", ())), "a worker")
    failure = task_failed(batch.job.label, batch.indices[0], error, where)
    failure.__cause__ = error
    return failure
