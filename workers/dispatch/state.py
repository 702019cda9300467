"""What the dispatcher knows: items that were asked for and have no result, tasks that are out, workers."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil, inf

TASK_SECONDS = 0.5
"""How long a task should take: a scheduler handles a few hundred tasks a second."""

SHORTEST_SECONDS = 0.2
"""How short a task may be where there is too little work for all threads."""

AHEAD = 4
"""Tasks out per thread, so that workers have work while the launcher is busy."""

STRIKES = 2
"""A batch of several items is halved after it has lost this number of processes."""

DEATHS = 5
"""An item that is alone in its batch is given up after it has lost this number of processes."""

HANGS = 2
"""An item that is alone in its batch is given up after it has hung this number of times."""

HANG_FACTOR = 30.0
"""A batch hangs after this many times what it should take, but not before `Rules.hang_seconds`."""

UNMEASURED = 10.0
"""The factor on `Rules.hang_seconds` for a kind of work of which no batch has come back yet."""

LATE_FACTOR = 5.0
"""A batch is late after this many times what it should take: more than `AHEAD`, so that what waits at a healthy
worker is not late."""

LATE_SECONDS = 5.0
"""A batch is never late before this many seconds."""

COPIES = 4
"""While other work waits, one in this many threads may repeat late batches, at least one thread."""


@dataclass(frozen=True)
class Rules:
    """What a user has decided.

    hang_seconds: the least time after which a batch counts as hanging
    wait_seconds: how long scheduler and workers may be away
    scheduler:    its address; None where it is part of this process
    """

    hang_seconds: float
    wait_seconds: float = inf
    scheduler: str | None = None

    def place(self, workers: int) -> str:
        """Where `workers` workers are, in words."""
        if self.scheduler is None:
            return f"{workers or 'no'} worker process{'es' * (workers != 1)} on this machine"
        return f"{self.scheduler} with {workers or 'no'} worker{'s' * (workers != 1)}"


@dataclass(eq=False)
class Work:
    """A job: how many items it has, and which of them are done. `seconds`: per item, as asked."""

    number: int
    label: str
    kind: str
    items: int
    seconds: float
    left: int = field(init=False)
    done: bytearray = field(init=False)

    def __post_init__(self) -> None:
        self.left, self.done = self.items, bytearray(self.items)

    def finish(self, indices: Sequence[int]) -> None:
        self.left -= len(indices)
        for index in indices:
            self.done[index] = 1


@dataclass
class Attempt:
    """One task that was sent out for a batch: when, and where and when it began."""

    submitted: float
    worker: str | None = None
    began: float | None = None


@dataclass(eq=False)
class Batch:
    """Items of a job that travel together.

    strikes:  processes that died with it; those of the batch that it is a half of count as one
    hangs:    how often it hung while it was one item
    unbegun:  how often the cluster gave it up before it or anything sent out later had begun
    doubted:  whether processes were lost with it, even if it is not known to have begun there
    errors:   how often it failed as a whole
    limit:    seconds after which it counts as hanging
    attempts: the tasks of it that are out, by key: two where it is late
    """

    work: Work
    indices: Sequence[int]
    strikes: int = 0
    hangs: int = 0
    unbegun: int = 0
    doubted: bool = False
    errors: int = 0
    limit: float = 0.0
    attempts: dict[int, Attempt] = field(default_factory=dict)

    def part(self, indices: Sequence[int]) -> Batch:
        """Some of its items, as far under suspicion as all."""
        return Batch(self.work, indices, self.strikes, doubted=self.doubted)


@dataclass
class State:
    """Everything that decides what an event leads to. Only `Dispatcher` changes it.

    works:         jobs with items that are not done, by number
    outstanding:   items without a result
    waiting:       batches to send out, in their order; `items_waiting` counts their items
    out:           the batch of each task that is out, by key
    late:          the keys among them of tasks that take much longer than they should
    raised:        how often items have raised, by job and index
    seconds:       measured per item, by kind of work
    latest_start:  when a task last began; before any has, -inf
    retries:       how often anything went out again
    threads:       of all workers, by address
    mismatched:    workers that have another version of the package
    usable:        `threads` of the workers that may get work; `slots` is their sum
    connected:     whether there is a scheduler
    opened:        when there first was one
    without_since: when the last usable worker was lost; None while there is one
    """

    rules: Rules
    now: float = -inf
    works: dict[int, Work] = field(default_factory=dict)
    outstanding: int = 0
    waiting: deque[Batch] = field(default_factory=deque)
    items_waiting: int = 0
    out: dict[int, Batch] = field(default_factory=dict)
    late: dict[int, Attempt] = field(default_factory=dict)
    raised: Counter[tuple[int, int]] = field(default_factory=Counter)
    seconds: dict[str, float] = field(default_factory=dict)
    next_key: int = 0
    latest_start: float = -inf
    retries: int = 0
    threads: dict[str, int] = field(default_factory=dict)
    mismatched: set[str] = field(default_factory=set)
    usable: dict[str, int] = field(default_factory=dict)
    slots: int = 0
    connected: bool = False
    opened: float | None = None
    without_since: float | None = None

    def cost(self, work: Work) -> float:
        """Seconds per item."""
        return max(1e-6, self.seconds.get(work.kind, work.seconds))

    def usual(self, batch: Batch) -> float:
        """Seconds that a batch should take."""
        return self.cost(batch.work) * len(batch.indices)

    def limit(self, batch: Batch) -> float:
        """Seconds after which a batch counts as hanging."""
        if batch.work.kind not in self.seconds:
            return UNMEASURED * self.rules.hang_seconds
        return max(self.rules.hang_seconds, HANG_FACTOR * self.usual(batch))

    def size(self, work: Work) -> int:
        """How many items of `work` make a batch now: fewer where there is too little work for all threads."""
        cost = self.cost(work)
        share = ceil(self.items_waiting / self.slots)
        return max(1, min(int(TASK_SECONDS / cost), max(share, int(SHORTEST_SECONDS / cost))))

    def late_tasks(self) -> dict[int, Attempt]:
        """Tasks that have run much longer than they should, or wait while a task that was sent later has begun."""
        slowest = max((self.usual(batch) for batch in self.out.values()), default=0.0)
        late = {}
        for key, batch in self.out.items():
            attempt = batch.attempts[key]
            if attempt.began is not None:
                is_late = self.now - attempt.began > max(LATE_SECONDS, LATE_FACTOR * self.usual(batch))
            else:
                overtaken = self.latest_start > attempt.submitted
                is_late = overtaken and self.now - attempt.submitted > max(LATE_SECONDS, LATE_FACTOR * slowest)
            if is_late:
                late[key] = attempt
        return late

    def stuck(self) -> list[str]:
        """The worker of each late task that has begun."""
        return [attempt.worker for attempt in self.late.values() if attempt.worker is not None]

    def to_repeat(self) -> list[Batch]:
        """Late batches to send out a second time, as many as leave other work its threads."""
        threads = self.slots - len(self.stuck())
        idle = threads - (len(self.out) - len(self.late)) if not self.waiting else 0
        copies = len(self.out) - len(set(self.out.values()))
        room = min(threads, max(idle, max(1, self.slots // COPIES) - copies))
        once = [self.out[key] for key in self.late if len(self.out[key].attempts) == 1]
        return once[: max(0, room)]
