"""What happens in a worker: a batch of items is run, and whatever goes wrong with one is told apart."""

from __future__ import annotations

import faulthandler
import importlib.metadata
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Lock, get_ident
from typing import Any

from distributed import Worker, get_worker

from fitters.errors import FittersError
from workers.attempt import attempt
from workers.context import Recipe, context_of

PACKAGE = "gpsearch"
WATCHDOG_GRACE = 5.0
"""Seconds past a task's limit after which its process is ended: by then the launcher has given the task up."""

FLUSH_SECONDS = 0.02
"""How long a suspect task waits, so that the word of its start is out before it can take the process with it."""


class ForeignWorkerError(RuntimeError):
    """A task came to a worker with another version of the package."""


@dataclass(frozen=True)
class Task:
    """All that travels to a worker.

    key, topic: as what, and where, the start is announced
    version:    of the launcher's package
    limit:      seconds after which the task is taken to hang
    suspect:    whether a process was lost with these items before
    """

    function: Callable[[Any, Any], Any]
    recipe: Recipe
    items: tuple[Any, ...]
    key: str
    topic: str
    version: str
    limit: float
    suspect: bool


@dataclass(frozen=True)
class Report:
    """What a task brings back: a result or `Raised` per item, where, and seconds without loading the context."""

    results: list[Any]
    worker: str
    seconds: float


def run_task(task: Task) -> Report:
    """Runs the items of a task. Bad input raises `FittersError`, with the worker as a note."""
    worker = get_worker()
    if (version := importlib.metadata.version(PACKAGE)) != task.version:
        raise ForeignWorkerError(f"{worker.address} has {PACKAGE} {version}")
    try:
        context = context_of(task.recipe)
        _announce(worker, task)
        began = time.perf_counter()
        with _ended_after(task.limit + WATCHDOG_GRACE):
            results = [attempt(task.function, context, item) for item in task.items]
    except FittersError as error:
        error.add_note(f"worker {worker.address}")
        raise
    return Report(results, worker.address, time.perf_counter() - began)


def _announce(worker: Worker, task: Task) -> None:
    worker.log_event(task.topic, {"began": task.key, "worker": worker.address})
    if task.suspect:
        time.sleep(FLUSH_SECONDS)


_deadlines: dict[int, float] = {}
_lock = Lock()


@contextmanager
def _ended_after(seconds: float) -> Iterator[None]:
    """Ends this process where its body takes longer, even in compiled code that never returns.

    faulthandler's watchdog is a thread of C that needs no interpreter lock; the stack goes to the worker's log.
    """
    _set_deadline(get_ident(), time.monotonic() + seconds)
    try:
        yield
    finally:
        _set_deadline(get_ident(), None)


def _set_deadline(thread: int, deadline: float | None) -> None:
    """There is one watchdog per process: it is wound up for the thread whose deadline comes first."""
    with _lock:
        if deadline is None:
            _deadlines.pop(thread, None)
        else:
            _deadlines[thread] = deadline
        if _deadlines:
            faulthandler.dump_traceback_later(max(0.1, min(_deadlines.values()) - time.monotonic()), exit=True)
        else:
            faulthandler.cancel_dump_traceback_later()
