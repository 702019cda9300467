"""Which work goes out, again and no more: sequences of events, without a cluster."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Collection
from math import ceil, log2
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.workers import work
from workers.attempt import RAISES, Raised
from workers.dispatch import (
    AHEAD,
    DEATHS,
    HANGS,
    LATE_SECONDS,
    SHORTEST_SECONDS,
    STRIKES,
    TASK_SECONDS,
    UNMEASURED,
    Dispatch,
    Submission,
)
from workers.jobs import Done, Failure, Job

HANG = 10.0
ALLOWED_FAILURES = 3


def job(count: int, *, seconds: float = 0.1, label: str = "fit") -> Job:
    return Job(work.square, work.RECIPE, range(count), label, seconds)


def sizes(submissions: Collection[Submission]) -> list[int]:
    return [len(submission.batch.indices) for submission in submissions]


def finish(dispatch: Dispatch, submission: Submission, per_item: float = 0.1) -> list[Done]:
    indices = submission.batch.indices
    return dispatch.finished(submission.key, list(indices), per_item * len(indices))


class Cluster:
    """What a scheduler and single-threaded workers do with what a `Dispatch` submits, a turn at a time."""

    def __init__(self, dispatch: Dispatch, workers: int, result: Callable[[int], Any] = lambda n: n) -> None:
        self.dispatch, self.result = dispatch, result
        self.now = 0.0
        self.queues: dict[str, list[Submission]] = {f"w{n}": [] for n in range(workers)}
        self.running: dict[str, Submission] = {}
        self.failures: Counter[str] = Counter()
        self.delivered: list[Done] = []
        self.deaths = 0
        self._joined = workers

    @property
    def keys(self) -> set[str]:
        waiting = {submission.key for queue in self.queues.values() for submission in queue}
        return waiting | {submission.key for submission in self.running.values()}

    def send(self) -> None:
        for submission in self.dispatch.submissions(len(self.queues), self.now):
            self._place(submission)
        self._cancel()

    def _place(self, submission: Submission) -> None:
        fit = [name for name in self.queues if name not in submission.avoid] or list(self.queues)
        load = {name: len(self.queues[name]) + (name in self.running) for name in fit}
        self.queues[min(fit, key=lambda name: (load[name], name))].append(submission)

    def _cancel(self) -> None:
        """What runs cannot be cancelled; it reports all the same."""
        cancelled = set(self.dispatch.cancelled)
        self.dispatch.cancelled.clear()
        for queue in self.queues.values():
            queue[:] = [submission for submission in queue if submission.key not in cancelled]

    def begin(self, name: str) -> bool:
        if name in self.running or not self.queues[name]:
            return False
        self.running[name] = self.queues[name].pop(0)
        self.dispatch.began(self.running[name].key, name, self.now)
        return True

    def end(self, name: str, per_item: float = 0.1) -> bool:
        if name not in self.running:
            return False
        submission = self.running.pop(name)
        results = [self.result(n) for n in submission.batch.indices]
        self.delivered += self.dispatch.finished(submission.key, results, per_item * len(results))
        return True

    def kill(self, name: str) -> None:
        """A fresh worker takes the dead one's place; the scheduler gives its tasks to others, or gives them up."""
        self.deaths += 1
        lost = [self.running.pop(name)] if name in self.running else []
        lost += self.queues.pop(name)
        self._joined += 1
        self.queues[f"w{self._joined}"] = []
        given_up = []
        for submission in lost:
            self.failures[submission.key] += 1
            if self.failures[submission.key] > ALLOWED_FAILURES:
                given_up.append(submission)
            else:
                self._place(submission)
        keys = [submission.key for submission in lost]
        self.delivered += self.dispatch.worker_left(name, keys, died=True)
        for submission in given_up:
            self.dispatch.dropped(submission.key)
        self._cancel()

    def lose_scheduler(self) -> None:
        self.dispatch.scheduler_lost()
        for name in self.queues:
            self.queues[name] = []
        self.running.clear()
        assert self.dispatch.cancelled == []

    def look(self) -> None:
        self.delivered += self.dispatch.overdue(self.now)
        self._cancel()

    def run_to_the_end(self, deadly: Collection[int] = (), hanging: Collection[int] = ()) -> None:
        for _ in range(100_000):
            if not self.dispatch.outstanding:
                return
            self.look()
            self.send()
            for name in list(self.queues):
                self.begin(name)
            for name, submission in list(self.running.items()):
                if set(submission.batch.indices) & set(deadly):
                    self.kill(name)
                elif not set(submission.batch.indices) & set(hanging):
                    self.end(name)
                elif self.dispatch.batch(submission.key) is None:
                    # The watchdog has ended the process after the launcher gave it up.
                    self.kill(name)
            self.now += 1.0
        raise AssertionError(f"{self.dispatch.outstanding} items are still outstanding")


def values(delivered: list[Done]) -> dict[int, Any]:
    assert len({(done.job, done.index) for done in delivered}) == len(delivered)
    return {done.index: done.result for done in delivered}


def assert_nothing_is_left(dispatch: Dispatch) -> None:
    assert dispatch.outstanding == 0
    assert not dispatch._out
    assert not dispatch._waiting
    assert not dispatch._raised


# sizes


def test_batches_follow_what_is_expected_and_then_what_was_measured() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(1000, seconds=0.05))
    first = list(dispatch.submissions(2, 0.0))
    assert sizes(first) == [int(TASK_SECONDS / 0.05)] * 2 * AHEAD
    for submission in first:
        finish(dispatch, submission, per_item=0.01)
    assert sizes(list(dispatch.submissions(2, 1.0))) == [int(TASK_SECONDS / 0.01)] * 2 * AHEAD


def test_a_kind_of_work_has_its_own_cost() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(1, label="screen island 1"))
    (only,) = dispatch.submissions(1, 0.0)
    finish(dispatch, only, per_item=0.001)
    dispatch.add(job(1000, label="screen island 2"))
    dispatch.add(job(1000, label="refine island 2"))
    assert [submission.batch.job.kind for submission in dispatch.submissions(1, 0.0)] == ["screen"] * 2 + [
        "refine"
    ] * 2


def test_little_work_is_spread_over_all_threads_but_not_thinner_than_worthwhile() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(12, seconds=0.1))
    assert sizes(list(dispatch.submissions(4, 0.0))) == [3, 3, 2, 2, 2]
    dispatch = Dispatch(HANG)
    dispatch.add(job(100, seconds=0.001))
    assert sizes(list(dispatch.submissions(64, 0.0))) == [100]
    assert SHORTEST_SECONDS / 0.001 > 100


def test_what_takes_long_goes_out_alone() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(3, seconds=20.0))
    assert sizes(list(dispatch.submissions(2, 0.0))) == [1, 1, 1]


def test_no_more_goes_out_than_keeps_the_threads_busy() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(1000, seconds=1.0))
    first = list(dispatch.submissions(2, 0.0))
    assert len(first) == 2 * AHEAD
    assert list(dispatch.submissions(2, 0.1)) == []
    finish(dispatch, first[0], per_item=1.0)
    assert len(list(dispatch.submissions(2, 0.2))) == 1


# mishaps


@pytest.mark.parametrize("count", [1, 2, 5, 16, 200])
def test_a_deadly_item_is_found_and_is_the_only_one_given_up(count: int) -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(count, seconds=0.5 / count))
    cluster = Cluster(dispatch, workers=2)
    cluster.run_to_the_end(deadly={count // 2})
    found = values(cluster.delivered)
    assert isinstance(found.pop(count // 2), Failure)
    assert found == {n: n for n in range(count) if n != count // 2}
    assert cluster.deaths <= STRIKES + ceil(log2(count)) + DEATHS
    assert_nothing_is_left(dispatch)


def test_what_waited_at_a_worker_that_died_is_not_blamed() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(8, seconds=1.0))
    cluster = Cluster(dispatch, workers=1)
    cluster.run_to_the_end(deadly={0})
    assert [index for index, result in values(cluster.delivered).items() if isinstance(result, Failure)] == [0]
    assert cluster.deaths == DEATHS


def test_processes_that_die_before_anything_begins_are_not_the_fault_of_an_item() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(1))
    (first,) = dispatch.submissions(1, 0.0)
    dispatch.worker_left("w", [first.key], died=True)
    assert dispatch.dropped(first.key)
    (second,) = dispatch.submissions(1, 1.0)
    assert second.batch.doubted
    assert not dispatch.dropped(second.key)


def test_a_crash_before_the_word_of_the_start_was_out_is_found_out_at_the_next_attempt() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(1))
    (first,) = dispatch.submissions(1, 0.0)
    assert dispatch.dropped(first.key)
    (second,) = dispatch.submissions(1, 1.0)
    assert second.batch.doubted
    for death in range(DEATHS):
        dispatch.began(second.key, f"w{death}", 2.0)
        done = dispatch.worker_left(f"w{death}", [second.key], died=True)
    assert "died" in done[0].result.reason


@pytest.mark.parametrize("count", [1, 8])
def test_a_hanging_item_is_found_and_given_up(count: int) -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(count, seconds=0.5 / count))
    cluster = Cluster(dispatch, workers=2)
    cluster.run_to_the_end(hanging={0})
    found = values(cluster.delivered)
    failure = found.pop(0)
    assert "did not end within" in failure.reason
    assert f"{HANGS} times" in failure.reason
    assert found == {n: n for n in range(1, count)}
    assert_nothing_is_left(dispatch)


def test_work_of_which_nothing_is_measured_gets_more_time_until_something_is() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(2, seconds=1.0))
    slow, quick = dispatch.submissions(2, 0.0)
    dispatch.began(slow.key, "w0", 0.0)
    dispatch.began(quick.key, "w1", 0.0)
    dispatch.overdue(UNMEASURED * HANG)
    assert dispatch.batch(slow.key) is not None
    finish(dispatch, quick)
    dispatch.overdue(HANG + 1)
    assert dispatch.batch(slow.key) is None


def test_what_raises_is_tried_three_times_and_costs_the_others_of_its_batch_nothing() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(5))
    tries: Counter[int] = Counter()

    def result(n: int) -> Any:
        tries[n] += 1
        return Raised("KeyError: 'gone'") if n == 3 else n

    cluster = Cluster(dispatch, workers=1, result=result)
    cluster.run_to_the_end()
    assert values(cluster.delivered) == {0: 0, 1: 1, 2: 2, 3: Failure("raised KeyError: 'gone'"), 4: 4}
    assert tries == {0: 1, 1: 1, 2: 1, 3: RAISES, 4: 1}
    assert_nothing_is_left(dispatch)


def test_what_raises_once_is_no_failure() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(1))
    (first,) = dispatch.submissions(1, 0.0)
    assert dispatch.finished(first.key, [Raised("OSError")], 0.1) == []
    (again,) = dispatch.submissions(1, 0.0)
    assert values(finish(dispatch, again)) == {0: 0}
    assert_nothing_is_left(dispatch)


def test_a_worker_that_leaves_with_notice_is_no_strike() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(1))
    (only,) = dispatch.submissions(1, 0.0)
    for turn in range(2 * DEATHS):
        dispatch.began(only.key, f"w{turn}", turn)
        assert dispatch.worker_left(f"w{turn}", [only.key], died=False) == []
    # What it had begun there counts no more either.
    assert dispatch.overdue(1e9) == []
    assert values(finish(dispatch, only)) == {0: 0}


def test_a_batch_that_fails_as_a_whole_is_tried_twice() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(1))
    (first,) = dispatch.submissions(1, 0.0)
    assert dispatch.erred(first.key)
    (second,) = dispatch.submissions(1, 0.0)
    assert not dispatch.erred(second.key)


# what is late


def late_work(threads: int, count: int) -> tuple[Dispatch, list[Submission]]:
    """A measured kind, and the first batch of it begun at "frozen", at 0."""
    dispatch = Dispatch(1000.0)
    dispatch.add(job(1, seconds=1.0))
    (only,) = dispatch.submissions(threads, 0.0)
    finish(dispatch, only, per_item=1.0)
    dispatch.add(job(count, seconds=1.0))
    out = list(dispatch.submissions(threads, 0.0))
    dispatch.began(out[0].key, "frozen", 0.0)
    return dispatch, out


def test_what_is_late_goes_out_once_more_and_no_more_than_once() -> None:
    dispatch, (slow,) = late_work(threads=2, count=1)
    assert list(dispatch.submissions(2, LATE_SECONDS)) == []
    (copy,) = dispatch.submissions(2, LATE_SECONDS + 1)
    assert copy.batch is slow.batch
    assert copy.avoid == {"frozen"}
    assert list(dispatch.submissions(2, 100.0)) == []
    dispatch.began(copy.key, "other", 100.0)
    assert list(dispatch.submissions(2, 200.0)) == []
    assert values(finish(dispatch, copy)) == {0: 0}
    assert dispatch.cancelled.count(slow.key) == 1
    assert finish(dispatch, slow) == []
    assert_nothing_is_left(dispatch)


def test_nothing_goes_out_again_where_no_thread_could_take_it() -> None:
    dispatch, _ = late_work(threads=1, count=1)
    assert list(dispatch.submissions(1, 100.0)) == []


def test_only_some_threads_repeat_what_is_late_while_other_work_waits() -> None:
    dispatch, out = late_work(threads=8, count=100)
    for number, submission in enumerate(out[1:4]):
        dispatch.began(submission.key, f"frozen{number}", 0.0)
    later = list(dispatch.submissions(8, 6.0))
    copies = [submission for submission in later if len(submission.batch.out) == 2]
    assert len(copies) == 2
    assert copies == later[:2]


def test_a_frozen_worker_cannot_take_all_that_goes_out() -> None:
    """Everything out sits at a frozen worker, most of it not begun, while more waits."""
    dispatch, out = late_work(threads=2, count=100)
    assert len(out) == 2 * AHEAD
    (copy,) = dispatch.submissions(2, 6.0)
    dispatch.began(copy.key, "healthy", 6.5)
    finish(dispatch, copy, per_item=1.0)
    more = list(dispatch.submissions(2, 7.0))
    repeated = [submission for submission in more if len(submission.batch.out) == 2]
    assert repeated
    assert repeated[0].batch in [submission.batch for submission in out]
    assert len(more) > len(repeated)


def test_work_that_waits_while_all_processes_still_load_is_not_late() -> None:
    dispatch = Dispatch(HANG)
    dispatch.add(job(1000, seconds=1.0))
    list(dispatch.submissions(2, 0.0))
    assert list(dispatch.submissions(2, 1000.0)) == []


# everything at once


EVENTS = [
    "jobs",
    "send",
    "begin",
    "begin",
    "end",
    "end",
    "kill",
    "leave",
    "lost",
    "drop",
    "refuse",
    "late",
    "look",
]


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    counts=st.lists(st.integers(0, 40), min_size=1, max_size=4),
    workers=st.integers(1, 4),
    seed=st.integers(0, 2**32 - 1),
    steps=st.integers(0, 200),
)
def test_whatever_happens_each_item_is_delivered_once(
    counts: list[int], workers: int, seed: int, steps: int
) -> None:
    dice = random.Random(seed)
    dispatch = Dispatch(HANG)
    jobs = [job(count, seconds=dice.choice([0.001, 0.1, 3.0]), label=f"kind{n}") for n, count in enumerate(counts)]
    cluster = Cluster(dispatch, workers, result=lambda n: Raised("OSError") if dice.random() < 0.05 else n)
    waiting = list(jobs)
    late: list[tuple[Submission, list[int]]] = []

    def random_key() -> str | None:
        return dice.choice(sorted(cluster.keys)) if cluster.keys else None

    def withdraw(key: str) -> None:
        for queue in cluster.queues.values():
            queue[:] = [submission for submission in queue if submission.key != key]
        cluster.running = {name: other for name, other in cluster.running.items() if other.key != key}

    for _ in range(steps):
        name = dice.choice(sorted(cluster.queues))
        key = random_key()
        match dice.choice(EVENTS):
            case "jobs" if waiting:
                dispatch.add(waiting.pop())
            case "send":
                cluster.send()
            case "begin":
                cluster.begin(name)
            case "end":
                if name in cluster.running and dice.random() < 0.2:
                    late.append((cluster.running[name], list(cluster.running[name].batch.indices)))
                cluster.end(name, per_item=dice.choice([0.001, 0.1, 3.0]))
            case "kill":
                cluster.kill(name)
            case "leave" if name in cluster.running:
                submission = cluster.running.pop(name)
                cluster.delivered += dispatch.worker_left(name, [submission.key], died=False)
                cluster._place(submission)
            case "lost" if dice.random() < 0.3:
                cluster.lose_scheduler()
            case "drop" | "refuse" as what if key:
                withdraw(key)
                dispatch.dropped(key) if what == "drop" else dispatch.refused(key)
            case "late" if late:
                submission, results = dice.choice(late)
                assert dispatch.finished(submission.key, results, 0.1) == []
            case "look":
                cluster.now += dice.choice([0.1, 1.0, 10.0])
                cluster.look()
        missing = sum(len(job.items) for job in jobs) - sum(len(job.items) for job in waiting)
        assert dispatch.outstanding == missing - len(cluster.delivered)
        assert dispatch._out.keys() <= cluster.keys
        assert all(len(batch.out) <= 2 for batch in dispatch._out.values())
    for job_left in waiting:
        dispatch.add(job_left)
    cluster.run_to_the_end()
    found = {(done.job, done.index): done.result for done in cluster.delivered}
    assert len(found) == len(cluster.delivered) == sum(counts)
    assert all(isinstance(result, Failure) or result == index for (_, index), result in found.items())
    assert_nothing_is_left(dispatch)


def test_whatever_still_runs_at_the_end_is_cancelled() -> None:
    dispatch, out = late_work(threads=2, count=1)
    (copy,) = dispatch.submissions(2, 10.0)
    dispatch.cancelled.clear()
    finish(dispatch, copy)
    assert out[0].key in dispatch.cancelled
    dispatch.add(job(3))
    more = list(dispatch.submissions(2, 11.0))
    dispatch.clear()
    assert {submission.key for submission in more} <= set(dispatch.cancelled)
    assert_nothing_is_left(dispatch)
