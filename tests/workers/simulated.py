"""A dispatcher under test, and a scheduler with workers that do what it says, a step at a time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from math import inf
from typing import Any

from workers.context import Raised
from workers.dispatch.dispatcher import Dispatcher
from workers.dispatch.events import (
    Asked,
    Began,
    Cancel,
    Connected,
    Deliver,
    Disconnected,
    Dropped,
    Event,
    Finished,
    GiveUp,
    Record,
    Stop,
    Submit,
    Tick,
    WorkerLeft,
    WorkersListed,
)
from workers.dispatch.replay import logged
from workers.dispatch.state import Rules
from workers.jobs import Failure

HANG = 10.0
ALLOWED_FAILURES = 3


class Trial:
    """Asks a dispatcher as an executor does, checks its invariants after every event and keeps its log.

    threads: of its workers, by name; a number stands for workers "w0", "w1", ... of one thread
    results: by job and index
    """

    def __init__(
        self, threads: int | Mapping[str, int] = 1, hang_seconds: float = HANG, wait_seconds: float = inf
    ) -> None:
        self.now = 0.0
        self.lines: list[str] = []
        self.results: dict[tuple[int, int], Any] = {}
        self.cancelled: list[int] = []
        self.records: list[Record] = []
        self.stops: list[str] = []
        self.jobs = 0
        self.dispatcher = Dispatcher(Rules(hang_seconds, wait_seconds, "tcp://scheduler:1"))
        self.state = self.dispatcher.state
        self._answer = logged(self.dispatcher, self.lines.append)
        self.threads = {f"w{n}": 1 for n in range(threads)} if isinstance(threads, int) else dict(threads)
        self.handle(Connected(0.0, self.threads, {}))

    def handle(self, event: Event, results: Sequence[Any] = ()) -> list[Submit]:
        """The tasks to send out now; everything else is noted here."""
        submitted = []
        for instruction in self._answer(event):
            match instruction:
                case Submit():
                    submitted.append(instruction)
                case Cancel(key):
                    self.cancelled.append(key)
                case Deliver(job, indices, positions):
                    for index, position in zip(indices, positions, strict=True):
                        self._note(job, index, results[position])
                case GiveUp(job, index, reason):
                    self._note(job, index, Failure(reason))
                case Record():
                    self.records.append(instruction)
                case Stop(reason):
                    self.stops.append(reason)
        return submitted

    def _note(self, job: int, index: int, result: Any) -> None:
        assert (job, index) not in self.results
        self.results[job, index] = result

    def ask(self, items: int, seconds: float = 0.1, label: str = "fit") -> list[Submit]:
        """For the next job, whose number is `jobs` - 1 afterwards."""
        self.jobs += 1
        return self.handle(Asked(self.now, self.jobs - 1, label, label.split()[0], items, seconds))

    def tick(self, now: float) -> list[Submit]:
        self.now = now
        return self.handle(Tick(now))

    def began(self, submit: Submit, worker: str, now: float) -> list[Submit]:
        self.now = now
        return self.handle(Began(now, submit.key, worker))

    def finish(self, submit: Submit, per_item: float = 0.1, results: Sequence[Any] | None = None) -> list[Submit]:
        """Each result is the item's index, or what `results` says; `Raised` among them."""
        values = list(submit.indices) if results is None else results
        raised = [(n, value.text) for n, value in enumerate(values) if isinstance(value, Raised)]
        return self.handle(Finished(self.now, submit.key, per_item * len(values), raised), values)

    def died(self, worker: str, *tasks: Submit) -> list[Submit]:
        return self.handle(WorkerLeft(self.now, worker, [task.key for task in tasks], died=True))

    def of_job(self, job: int) -> dict[int, Any]:
        """The results of one job so far, by index."""
        return {index: result for (number, index), result in self.results.items() if number == job}

    def require_nothing_left(self) -> None:
        assert self.state.outstanding == 0
        kept = (self.state.works, self.state.waiting, self.state.out, self.state.late, self.state.raised)
        assert not any(kept)


class SimulatedCluster:
    """A scheduler and single-threaded workers, which run what a `Trial` submits."""

    def __init__(self, workers: int, result: Callable[[int], Any] = lambda n: n) -> None:
        self.trial, self.result = Trial(workers), result
        self.queues: dict[str, list[Submit]] = {name: [] for name in self.trial.threads}
        self.running: dict[str, Submit] = {}
        self.failures: Counter[int] = Counter()
        self.deaths = 0
        self._joined = workers

    @property
    def tasks(self) -> list[Submit]:
        """All that the cluster has."""
        return [*(task for queue in self.queues.values() for task in queue), *self.running.values()]

    def tell(self, event: Event, results: Sequence[Any] = ()) -> None:
        """An event for the dispatcher; what it submits is queued, and what it cancels leaves the queues."""
        self.place(self.trial.handle(event, results))

    def place(self, tasks: Collection[Submit]) -> None:
        for task in tasks:
            names = [name for name in self.queues if task.workers is None or name in task.workers]
            names = names or list(self.queues)
            load = {name: len(self.queues[name]) + (name in self.running) for name in names}
            self.queues[min(names, key=lambda name: (load[name], name))].append(task)
        # What runs cannot be cancelled; it reports all the same.
        cancelled = set(self.trial.cancelled)
        for queue in self.queues.values():
            queue[:] = [task for task in queue if task.key not in cancelled]

    def begin(self, name: str) -> None:
        if name not in self.running and self.queues[name]:
            self.running[name] = self.queues[name].pop(0)
            self.tell(Began(self.trial.now, self.running[name].key, name))

    def end(self, name: str, per_item: float = 0.1) -> None:
        if name in self.running:
            task = self.running.pop(name)
            self.place(self.trial.finish(task, per_item, [self.result(n) for n in task.indices]))

    def kill(self, name: str) -> None:
        """A fresh worker takes the dead one's place; the scheduler gives its tasks to others, or gives them up."""
        self.deaths += 1
        lost = [self.running.pop(name)] if name in self.running else []
        lost += self.queues.pop(name)
        self.join()
        for task in lost:
            self.failures[task.key] += 1
        given_up = [task for task in lost if self.failures[task.key] > ALLOWED_FAILURES]
        self.place([task for task in lost if task not in given_up])
        self.tell(WorkerLeft(self.trial.now, name, [task.key for task in lost], died=True))
        self.list_workers()
        for task in given_up:
            self.tell(Dropped(self.trial.now, task.key, name))

    def leave(self, name: str) -> None:
        """As `kill`, but with notice."""
        lost = [self.running.pop(name)] if name in self.running else []
        lost += self.queues.pop(name)
        self.join()
        self.place(lost)
        self.tell(WorkerLeft(self.trial.now, name, [task.key for task in lost], died=False))
        self.list_workers()

    def join(self) -> None:
        self.queues[f"w{self._joined}"] = []
        self._joined += 1

    def list_workers(self) -> None:
        self.tell(WorkersListed(self.trial.now, dict.fromkeys(self.queues, 1)))

    def lose_scheduler(self) -> None:
        """It comes back at once, with the same workers and none of the tasks."""
        for name in self.queues:
            self.queues[name] = []
        self.running.clear()
        self.tell(Disconnected(self.trial.now))
        self.tell(Connected(self.trial.now, dict.fromkeys(self.queues, 1), {}))

    def pass_time(self, seconds: float) -> None:
        self.place(self.trial.tick(self.trial.now + seconds))

    def run_to_the_end(self, deadly: Collection[int] = (), hanging: Collection[int] = ()) -> None:
        """Items at `deadly` kill their worker, those at `hanging` never end by themselves."""
        for _ in range(100_000):
            if not self.trial.state.outstanding:
                return
            self.pass_time(1.0)
            for name in list(self.queues):
                self.begin(name)
            for name, task in list(self.running.items()):
                if set(task.indices) & set(deadly):
                    self.kill(name)
                elif not set(task.indices) & set(hanging):
                    self.end(name)
                elif task.key not in self.trial.state.out:
                    # The watchdog has ended the process after the launcher gave it up.
                    self.kill(name)
        raise AssertionError(f"{self.trial.state.outstanding} items are still outstanding")
