"""Which items go out together, when they go out again, and when one is given up: the logic, without a cluster.

A `Dispatch` is told what happened and at what time, and says what to submit and to cancel. It has no clock and
does no I/O, so that every mishap can be tested as a sequence of calls.

Items travel in batches of about `TASK_SECONDS`. A batch that loses its process twice, or hangs, is halved until
the item that does it is alone; that one is given up after `DEATHS` processes or `HANGS` time limits. A batch that
takes much longer than it should goes out once more, to another worker: functions are pure, so that the first
result counts.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from math import ceil, inf
from typing import Any

from workers.attempt import RAISES, Raised
from workers.jobs import Done, Failure, Job

TASK_SECONDS = 0.5
SHORTEST_SECONDS = 0.2
"""Of a batch, down to the shortest where there is little to do: a scheduler handles a few hundred a second."""

AHEAD = 4
"""Batches out per thread, so that workers have work while the launcher is busy."""

STRIKES = 2
DEATHS = 5
HANGS = 2
"""A batch is halved after so many lost processes; one item is given up after so many, or so many hangs."""

PATIENCE = 30.0
"""A batch hangs that takes so many times what it should, but not before the limit that is set for all."""

UNMEASURED = 10.0
"""The factor on that limit for work of which nothing is measured yet."""

LATE_FACTOR, LATE_SECONDS = 5.0, 5.0
"""A batch is late after so many times what it should take, and at least so long; more than `AHEAD`, so that what
waits at a worker that works is not."""

COPIES = 4
"""One in so many threads, or one, repeats what is late while other work waits; those that would be idle all do."""


@dataclass(eq=False)
class Batch:
    """Items of a job that go out together.

    strikes: processes that died with it; those of the batch that it is a half of count as one
    hangs:   limits that it ran into, when alone
    unbegun: how often the cluster gave it up though it had not begun, and nothing else had
    doubted: whether processes were lost with it, even if it is not known to have begun there
    errors:  how often it failed as a whole
    limit:   seconds after which it is taken to hang
    out:     under which keys it is out now
    """

    job: Job
    indices: Sequence[int]
    strikes: int = 0
    hangs: int = 0
    unbegun: int = 0
    doubted: bool = False
    errors: int = 0
    limit: float = 0.0
    out: dict[str, Attempt] = field(default_factory=dict)

    @property
    def items(self) -> tuple[Any, ...]:
        return tuple(self.job.items[i] for i in self.indices)


@dataclass
class Attempt:
    """One way to a result: when it was submitted, and where and when it began."""

    submitted: float
    worker: str | None = None
    began: float | None = None


@dataclass(frozen=True)
class Submission:
    """A batch to submit under a key, if possible not to workers that are stuck."""

    key: str
    batch: Batch
    avoid: frozenset[str] = frozenset()


class Dispatch:
    """All items that were asked for and are not done.

    cancelled: keys that nobody needs any more, for the owner to cancel and clear
    retries:   how often anything went out again
    """

    def __init__(self, hang_seconds: float) -> None:
        self._hang_seconds = hang_seconds
        self._waiting: deque[Batch] = deque()
        self._out: dict[str, Batch] = {}
        self._numbers = count()
        self._seconds: dict[str, float] = {}
        self._raised: Counter[tuple[Job, int]] = Counter()
        self._latest_start = -inf
        self.cancelled: list[str] = []
        self.retries = 0

    @property
    def outstanding(self) -> int:
        """Items without a result."""
        return self._items_waiting + sum(len(batch.indices) for batch in set(self._out.values()))

    @property
    def _items_waiting(self) -> int:
        return sum(len(batch.indices) for batch in self._waiting)

    def batch(self, key: str) -> Batch | None:
        """What is out under a key; None where nobody needs it any more."""
        return self._out.get(key)

    # what is asked for

    def add(self, job: Job) -> None:
        if job.items:
            self._waiting.append(Batch(job, range(len(job.items))))

    def clear(self) -> None:
        """Nothing is asked for any more."""
        self.cancelled += self._out
        self._out.clear()
        self._waiting.clear()
        self._raised.clear()

    def submissions(self, threads: int, now: float) -> Iterator[Submission]:
        """What to submit now, given so many threads in the cluster."""
        late = self._late(now)
        stuck = [attempt.worker for attempt in late.values() if attempt.worker is not None]
        avoid = frozenset(stuck)
        for batch in self._to_repeat(late, threads, len(stuck)):
            self.retries += 1
            yield self._submitted(batch, now, avoid)
        while self._waiting and len(self._out) - len(late) < AHEAD * threads:
            batch = self._next_batch(threads)
            batch.limit = self._limit(batch)
            yield self._submitted(batch, now, avoid)

    def _late(self, now: float) -> dict[str, Attempt]:
        """What is out, by key, and takes much longer than it should, or waits while later work has begun."""
        slowest = max((self._usual(batch) for batch in self._out.values()), default=0.0)
        late = {}
        for key, batch in self._out.items():
            attempt = batch.out[key]
            if attempt.began is not None:
                is_late = now - attempt.began > max(LATE_SECONDS, LATE_FACTOR * self._usual(batch))
            else:
                overtaken = self._latest_start > attempt.submitted
                is_late = overtaken and now - attempt.submitted > max(LATE_SECONDS, LATE_FACTOR * slowest)
            if is_late:
                late[key] = attempt
        return late

    def _to_repeat(self, late: dict[str, Attempt], threads: int, stuck: int) -> list[Batch]:
        """Those of the late ones that shall go out a second time, without keeping other work from the threads."""
        idle = threads - stuck - (len(self._out) - len(late)) if not self._waiting else 0
        copies = sum(len(batch.out) == 2 for batch in set(self._out.values()))
        room = min(threads - stuck, max(idle, max(1, threads // COPIES) - copies))
        found = [self._out[key] for key in late if len(self._out[key].out) == 1]
        return found[: max(0, room)]

    def _next_batch(self, threads: int) -> Batch:
        """The first that waits, or as many of its items as make a task."""
        batch = self._waiting.popleft()
        size = self._size(batch.job, threads, self._items_waiting + len(batch.indices))
        if len(batch.indices) <= size:
            return batch
        rest = Batch(batch.job, batch.indices[size:], batch.strikes, doubted=batch.doubted)
        self._waiting.appendleft(rest)
        return Batch(batch.job, batch.indices[:size], batch.strikes, doubted=batch.doubted)

    def _size(self, job: Job, threads: int, waiting: int) -> int:
        cost = self._cost(job)
        share = ceil(waiting / threads)
        return max(1, min(int(TASK_SECONDS / cost), max(share, int(SHORTEST_SECONDS / cost))))

    def _cost(self, job: Job) -> float:
        return max(1e-6, self._seconds.get(job.kind, job.seconds))

    def _limit(self, batch: Batch) -> float:
        if batch.job.kind not in self._seconds:
            return UNMEASURED * self._hang_seconds
        return max(self._hang_seconds, PATIENCE * self._usual(batch))

    def _usual(self, batch: Batch) -> float:
        return self._cost(batch.job) * len(batch.indices)

    def _submitted(self, batch: Batch, now: float, avoid: frozenset[str]) -> Submission:
        key = f"{next(self._numbers)}"
        self._out[key] = batch
        batch.out[key] = Attempt(now)
        return Submission(key, batch, avoid)

    # what happened

    def began(self, key: str, worker: str, now: float) -> None:
        if batch := self._out.get(key):
            batch.out[key].worker, batch.out[key].began = worker, now
            self._latest_start = now

    def finished(self, key: str, results: Sequence[Any], seconds: float) -> list[Done]:
        """Results of a batch, `Raised` in place of those whose function raised; they are tried elsewhere."""
        batch = self._out.get(key)
        if batch is None:
            return []
        self._forget(batch)
        self._measured(batch, seconds)
        done = []
        for index, result in zip(batch.indices, results, strict=True):
            if not isinstance(result, Raised):
                self._raised.pop((batch.job, index), None)
                done.append(Done(batch.job, index, result))
                continue
            self._raised[batch.job, index] += 1
            if self._raised[batch.job, index] < RAISES:
                self._again(Batch(batch.job, (index,)))
            else:
                del self._raised[batch.job, index]
                done.append(self._failed(batch.job, index, f"raised {result.text}"))
        return done

    def worker_left(self, worker: str, keys: Iterable[str], *, died: bool) -> list[Done]:
        """A worker is gone, with notice or without, which had these keys; the cluster gives them to others.

        Where it died, what had begun there is a suspect, and what merely waited there is not.
        """
        done = []
        mine = [key for key, batch in self._out.items() if batch.out[key].worker == worker]
        for key in mine:
            batch = self._out.get(key)
            if batch is None:
                continue
            batch.out[key].worker = batch.out[key].began = None
            if died:
                batch.strikes += 1
                self.retries += 1
                done += self._judged(batch)
        if died and not mine:
            for key in keys:
                if batch := self._out.get(key):
                    batch.doubted = True
        return done

    def _judged(self, batch: Batch) -> list[Done]:
        """After a death: the cluster repeats a batch by itself, unless it is halved or given up."""
        if len(batch.indices) > 1:
            if batch.strikes >= STRIKES:
                self._halve(batch)
        elif batch.strikes >= DEATHS:
            self._forget(batch)
            text = f"its worker process died, {batch.strikes} times; memory is the usual reason"
            return [self._failed(batch.job, batch.indices[0], text)]
        return []

    def dropped(self, key: str) -> bool:
        """The cluster gave a key up, after deaths as a rule: it goes out again.

        False where it has given up the same batch twice, and nothing at all began meanwhile: then no item is to
        blame.
        """
        batch = self._out.get(key)
        if batch is None:
            return True
        attempt = batch.out[key]
        batch.doubted = True
        batch.unbegun += attempt.began is None and self._latest_start < attempt.submitted and not batch.strikes
        self.refused(key)
        return batch.unbegun < 2

    def erred(self, key: str) -> bool:
        """A batch failed as a whole: it goes out again. False the second time."""
        batch = self._out.get(key)
        if batch is None:
            return True
        batch.errors += 1
        self.refused(key)
        return batch.errors < 2

    def refused(self, key: str) -> None:
        """A worker would not take it, or what it brought was lost: it goes out again."""
        if batch := self._out.pop(key, None):
            del batch.out[key]
            if not batch.out:
                self._again(batch)

    def scheduler_lost(self) -> None:
        """All that is out must go out again, and nobody is to blame."""
        batches = dict.fromkeys(self._out.values())
        self._out.clear()
        self.cancelled.clear()
        for batch in reversed(list(batches)):
            batch.out.clear()
            self._again(batch)

    def overdue(self, now: float) -> list[Done]:
        """Halves, repeats or gives up what hangs."""
        done = []
        for batch in list(dict.fromkeys(self._out.values())):
            began = [attempt.began for attempt in batch.out.values() if attempt.began is not None]
            batch.limit = min(batch.limit, self._limit(batch))
            if not began or now - min(began) <= batch.limit:
                continue
            batch.strikes += 1
            if len(batch.indices) > 1:
                self._halve(batch)
                continue
            self._forget(batch)
            batch.hangs += 1
            if batch.hangs < HANGS:
                self._again(batch)
            else:
                text = f"did not end within {batch.limit:g} s, {batch.hangs} times"
                done.append(self._failed(batch.job, batch.indices[0], text))
        return done

    # helpers

    def _halve(self, batch: Batch) -> None:
        self._forget(batch)
        middle = len(batch.indices) // 2
        for half in (batch.indices[middle:], batch.indices[:middle]):
            self._again(Batch(batch.job, half, strikes=1, doubted=True))

    def _again(self, batch: Batch) -> None:
        self.retries += 1
        self._waiting.appendleft(batch)

    def _forget(self, batch: Batch) -> None:
        """No key of it counts any more; those that may still run are cancelled."""
        for key in batch.out:
            del self._out[key]
            self.cancelled.append(key)
        batch.out.clear()

    def _measured(self, batch: Batch, seconds: float) -> None:
        """The cost of a kind of work follows what its latest batches took."""
        per_item = seconds / len(batch.indices)
        before = self._seconds.get(batch.job.kind)
        self._seconds[batch.job.kind] = per_item if before is None else 0.8 * before + 0.2 * per_item

    def _failed(self, job: Job, index: int, reason: str) -> Done:
        return Done(job, index, Failure(reason))
