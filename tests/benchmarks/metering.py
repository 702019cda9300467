"""What goes on while a search runs: its launcher's processor time by what it does, its tasks, other processes."""

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import psutil

from gpsearch.run import WritableStore
from gpsearch.search import island_search
from gpsearch.search.search import Search, SearchStatus
from tests.benchmarks.runs import Silent
from workers import Done, Executor, Job
from workers.dispatch.dispatcher import Dispatcher
from workers.dispatch.events import Event, Finished, Instruction

PARTS = ("breeding", "dispatch", "storing", "rest")
"""What a launcher does. Dispatch is also whatever its other threads do: they speak with the scheduler."""


@dataclass(frozen=True)
class Task:
    """What a task was: its items and the seconds that it took where it ran."""

    items: int
    seconds: float


@dataclass(frozen=True)
class Reading:
    """What has been until now.

    launcher: processor seconds by `PARTS`
    others:   processor seconds of other processes, by name
    """

    seconds: float
    launcher: Mapping[str, float]
    others: Mapping[str, float]


class Meter(Silent):
    """A watcher that reads all clocks when a search begins, and whenever a generation of all islands is whole."""

    def __init__(self, others: Mapping[str, Sequence[int]]) -> None:
        """`others`: process ids by the name under which they are added up."""
        self.readings: list[Reading] = []
        self.tasks: list[Task] = []
        self.results: list[Done] = []
        self._others = {name: [psutil.Process(pid) for pid in ids] for name, ids in others.items()}
        self._parts: Counter[str] = Counter()

    def stage(self, name: str, total: int | None) -> None:
        if name == "searching":
            self.readings.append(self._reading())

    def generation(self, status: SearchStatus) -> None:
        self.readings.append(self._reading())

    def _reading(self) -> Reading:
        parts = {part: self._parts[part] for part in PARTS}
        this_thread = time.thread_time()
        parts["rest"] = this_thread - sum(parts.values())
        parts["dispatch"] += time.process_time() - this_thread
        others = {name: sum(map(_cpu_seconds, processes)) for name, processes in self._others.items()}
        return Reading(time.monotonic(), parts, others)

    @contextmanager
    def clock(self, part: str) -> Iterator[None]:
        """Adds what this thread does within it to a part."""
        began = time.thread_time()
        try:
            yield
        finally:
            self._parts[part] += time.thread_time() - began

    @contextmanager
    def attached(self) -> Iterator[None]:
        """Within it, searches on this thread are metered."""
        handle = Dispatcher.handle

        def noted(dispatcher: Dispatcher, event: Event) -> list[Instruction]:
            if isinstance(event, Finished) and (batch := dispatcher.state.out.get(event.key)):
                self.tasks.append(Task(len(batch.indices), event.seconds))
            return handle(dispatcher, event)

        with ExitStack() as stack:
            stack.enter_context(patch.object(Dispatcher, "handle", noted))
            for name in ("advance", "smallest_of_each_form"):
                stack.enter_context(
                    patch.object(island_search, name, self._clocked("breeding", getattr(island_search, name)))
                )
            yield

    def _clocked(self, part: str, function: Any) -> Any:
        def clocked(*arguments: Any) -> Any:
            with self.clock(part):
                return function(*arguments)

        return clocked


def _cpu_seconds(process: psutil.Process) -> float:
    times = process.cpu_times()
    return times.user + times.system


class MeteredExecutor:
    """An executor whose own work on this thread counts as dispatch."""

    def __init__(self, executor: Executor, meter: Meter) -> None:
        self._executor, self._meter = executor, meter

    def __getattr__(self, name: str) -> Any:
        return getattr(self._executor, name)

    def submit(self, job: Job) -> None:
        with self._meter.clock("dispatch"):
            self._executor.submit(job)

    def wait(self, seconds: float) -> list[Done]:
        with self._meter.clock("dispatch"):
            done = self._executor.wait(seconds)
        self._meter.results += done
        return done


class MeteredStore(WritableStore):
    """A store whose transactions count as storing."""

    meter: Meter

    @contextmanager
    def transaction(self) -> Iterator[None]:
        with self.meter.clock("storing"), super().transaction():
            yield


class UndescribedSearch(Search):
    """A search that ends with its last generation."""

    def describe_front(self) -> None:
        """The front stays as it is."""
