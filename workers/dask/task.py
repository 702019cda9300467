"""What happens in a worker: the items of a task are run, and an error of one item is kept from the others."""

from __future__ import annotations

import faulthandler
import importlib.metadata
import pickle
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Lock, get_ident
from typing import Any

from distributed import Worker, get_worker

from workers.context import Recipe, attempt, context_of
from workers.dask.connection import Package

WATCHDOG_GRACE = 2.0
"""Seconds past a task's limit after which its process is ended: by then the launcher has given the task up."""

FLUSH_SECONDS, SUSPECT_FLUSH_SECONDS = 0.002, 0.05
"""How long a task waits, so that the word of its start is out before it can crash its process or hold its lock."""


class VersionDiffersError(RuntimeError):
    """A task came to a worker that has another version of the package. Its arguments: address, what is wrong."""


class Whole:
    """A dataclass that travels in one piece.

    Dask sends every array as a frame of its own, which for a batch of small ones costs launcher, scheduler and
    worker more than all the rest of a task.
    """

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _restored, (type(self), pickle.dumps(vars(self), pickle.HIGHEST_PROTOCOL))


def _restored(kind: type, packed: bytes) -> Any:
    return kind(**pickle.loads(packed))


@dataclass(frozen=True)
class Task(Whole):
    """All that travels to a worker.

    key, topic: as what, and where, the start is announced
    package:    whose version must be the same here; None where any will do
    limit:      seconds after which the task counts as hanging
    suspect:    whether a process was lost with these items before
    """

    function: Callable[[Any, Any], Any]
    recipe: Recipe
    items: tuple[Any, ...]
    key: int
    topic: str
    package: Package | None
    limit: float
    suspect: bool


@dataclass(frozen=True)
class Report(Whole):
    """What a task brings back: a result or `Raised` per item, and seconds without loading the context."""

    results: list[Any]
    seconds: float


def run_task(task: Task) -> Report:
    """Runs the items of a task. Raises what its recipe does, or `FittersError`, with the worker as a note."""
    worker = get_worker()
    if task.package and (fault := task.package.fault(importlib.metadata.version(task.package.name))):
        raise VersionDiffersError(worker.address, fault)
    try:
        context = context_of(task.recipe)
        _announce(worker, task)
        began = time.perf_counter()
        with _ended_after(task.limit + WATCHDOG_GRACE):
            results = [attempt(task.function, context, item) for item in task.items]
    except Exception as error:
        error.add_note(f"worker {worker.address}")
        raise
    return Report(results, time.perf_counter() - began)


def _announce(worker: Worker, task: Task) -> None:
    worker.log_event(task.topic, {"began": task.key, "worker": worker.address})
    time.sleep(SUSPECT_FLUSH_SECONDS if task.suspect else FLUSH_SECONDS)


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
