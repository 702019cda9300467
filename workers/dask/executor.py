"""The executor that sends tasks to Dask workers; only recipes, items and results travel.

It decides nothing: what happens on the cluster becomes events, and the instructions of a `Dispatcher` become
calls of Dask. A `Session` is one connection, a `Task` what travels to a worker.
"""

from __future__ import annotations

import importlib.metadata
import re
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from time import monotonic, sleep
from typing import Any
from uuid import uuid4

from distributed import Client

from workers.dask.connection import Package, connect, fault_of_scheduler, faults_of_workers
from workers.dask.processes import silenced_logs, start_processes
from workers.dask.session import Session
from workers.dask.settings import DaskSettings
from workers.dask.task import Task
from workers.dispatch.dispatcher import Dispatcher
from workers.dispatch.events import (
    Abandoned,
    Asked,
    Cancel,
    Connected,
    Deliver,
    Disconnect,
    Event,
    GiveUp,
    Instruction,
    Record,
    Stop,
    Submit,
    Tick,
    Unreachable,
)
from workers.dispatch.replay import handler
from workers.dispatch.state import Rules
from workers.errors import WorkersError
from workers.jobs import Done, Failure, Incident, Job

TICK_SECONDS = 0.25
"""How often the dispatcher hears that time has passed, and how long to wait between two attempts to connect."""

ATTEMPT_SECONDS = 2.0
"""How long one attempt to reach a scheduler that went away may take."""


@dataclass
class Outstanding:
    """A job, the name that its tasks have on the dashboard, and the number of items without a result."""

    job: Job
    name: str
    left: int


class DaskExecutor:
    """Runs jobs on a running scheduler, or on fresh processes of this machine. See `DaskSettings`."""

    def __init__(self, settings: DaskSettings, package: str | None = None) -> None:
        """Connects. Raises `WorkersError` where that fails, or nothing there has our version of `package`."""
        self._settings = settings
        self._package = None if package is None else Package(package, importlib.metadata.version(package))
        dispatcher = Dispatcher(Rules(settings.hang_seconds, settings.wait_seconds, settings.scheduler))
        self._state, self._answer = dispatcher.state, handler(dispatcher)
        self._jobs: dict[int, Outstanding] = {}
        self._asked = self._retries = 0
        self._done: list[Done] = []
        self._incidents: list[Incident] = []
        self._session: Session | None = None
        self._ticked = monotonic()
        with ExitStack() as resources:
            resources.enter_context(silenced_logs())
            self._connect(settings.wait_seconds)
            self._resources = resources.pop_all()

    @property
    def description(self) -> str:
        return self._state.rules.place(len(self._state.usable))

    @property
    def processes(self) -> int:
        """The threads of all workers that are there now, at least 1."""
        return max(1, self._state.slots)

    @property
    def outstanding(self) -> int:
        return self._state.outstanding + len(self._done)

    def submit(self, job: Job) -> None:
        """See `Executor.submit`."""
        number, count = self._asked, len(job.items)
        if count:
            self._asked += 1
            # A scheduler remembers the first word for ever, so that what varies comes after it.
            self._jobs[number] = Outstanding(job, f"{key_prefix(job.label)}-{uuid4().hex}", count)
            self._handle(Asked(monotonic(), number, job.label, job.kind, count, job.seconds))

    def wait(self, seconds: float) -> list[Done]:
        """See `Executor.wait`."""
        deadline = monotonic() + seconds
        while not self._done and self.outstanding:
            left = max(0.0, deadline - monotonic())
            if self._session is None:
                self._reconnect()
            else:
                for event, payload in self._session.events(min(left, TICK_SECONDS)):
                    self._handle(event, payload)
                    if self._session is None:
                        break
            if (now := monotonic()) - self._ticked > TICK_SECONDS:
                self._ticked = now
                self._handle(Tick(now))
            if not left:
                break
        done, self._done = self._done, []
        return done

    def abandon(self) -> None:
        """See `Executor.abandon`."""
        self._handle(Abandoned(monotonic()))
        self._jobs.clear()
        self._done.clear()

    def incidents(self) -> list[Incident]:
        """See `Executor.incidents`."""
        if self._state.retries > self._retries:
            self._incidents.append(Incident("retry", str(self._state.retries - self._retries)))
            self._retries = self._state.retries
        incidents, self._incidents = self._incidents, []
        return incidents

    def close(self) -> None:
        """Closes the client, and the processes where we started them."""
        with self._resources:
            self._disconnect()

    # events and instructions

    def _handle(self, event: Event, payload: Any = None) -> None:
        """Raises `WorkersError` where the dispatcher says so; an exception as `payload` is then its cause."""
        instructions = self._answer(event)
        if self._session is not None:
            self._session.cancel(
                instruction.key for instruction in instructions if isinstance(instruction, Cancel)
            )
        for instruction in instructions:
            self._follow(instruction, payload)
        for instruction in instructions:
            if isinstance(instruction, Stop):
                cause = payload if isinstance(payload, BaseException) else None
                raise WorkersError(instruction.reason) from cause

    def _follow(self, instruction: Instruction, payload: Any) -> None:
        match instruction:
            case Submit():
                self._send(instruction)
            case Deliver(number, indices, positions):
                job = self._jobs[number].job
                pairs = zip(indices, positions, strict=True)
                self._finish(number, [Done(job, index, payload[position]) for index, position in pairs])
            case GiveUp(number, index, reason):
                self._finish(number, [Done(self._jobs[number].job, index, Failure(reason))])
            case Record(kind, detail):
                self._incidents.append(Incident(kind, detail))
            case Disconnect():
                self._disconnect()

    def _finish(self, number: int, done: Sequence[Done]) -> None:
        self._done += done
        self._jobs[number].left -= len(done)
        if not self._jobs[number].left:
            del self._jobs[number]

    def _send(self, submit: Submit) -> None:
        if self._session is None or self._session.lost:
            # The session says so with its next event, and all that is out goes out again.
            return
        asked = self._jobs[submit.job]
        task = Task(
            function=asked.job.function,
            recipe=asked.job.recipe,
            items=tuple(asked.job.items[index] for index in submit.indices),
            key=submit.key,
            topic=self._session.topic,
            package=self._package,
            limit=submit.limit,
            suspect=submit.suspect,
        )
        self._session.submit(submit.key, asked.name, task, submit.workers)

    # the connection

    def _connect(self, seconds: float) -> None:
        """Raises `WorkersError` where no scheduler and worker are there within `seconds`."""
        with ExitStack() as resources:
            client = self._reach(seconds, resources)
            faults = client.sync(faults_of_workers, client, self._package)
            threads = dict(client.nthreads())
            scheduler_fault = client.sync(fault_of_scheduler, client, self._package)
            session = Session(client, self._package, threads)
            session.resources = resources.pop_all()
        self._session = session
        try:
            self._handle(Connected(monotonic(), threads, faults, scheduler_fault))
        except WorkersError:
            self._disconnect()
            raise

    def _reach(self, seconds: float, resources: ExitStack) -> Client:
        settings = self._settings
        if settings.scheduler is not None:
            return connect(settings.scheduler, seconds, resources, settings.tls)
        if self._state.opened is not None:
            raise WorkersError("its scheduler was part of this process")
        return start_processes(settings.workers, seconds, resources)

    def _reconnect(self) -> None:
        """One attempt. Raises `WorkersError` where the scheduler has been away for longer than the rules allow."""
        try:
            self._connect(ATTEMPT_SECONDS)
        except Exception as error:
            # A scheduler that has just come back may go away in the middle of anything.
            self._handle(Unreachable(monotonic(), str(error)), error)
        if self._session is None:
            sleep(TICK_SECONDS)

    def _disconnect(self) -> None:
        session, self._session = self._session, None
        if session is not None:
            session.close()


def key_prefix(label: str) -> str:
    """`label` as the start of a task key: letters, digits and dashes, a letter first.

    Dask's dashboard groups tasks by the key's leading dash-separated words that hold letters only
    (`dask.utils.key_split`): `screen-island2-generation7` counts as `screen`. Since a scheduler remembers every
    such prefix for ever, put what varies after them.
    """
    key = re.sub(r"[^A-Za-z0-9]+", "-", label).strip("-")
    return key if key[:1].isalpha() else f"task-{key}"
