"""Which work goes out, again and no more: events and instructions, without a cluster."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from math import ceil, log2
from typing import Any

import pytest

from tests.workers.simulated import HANG, SimulatedCluster, Trial
from workers.context import RAISES, Raised
from workers.dispatch.events import (
    Abandoned,
    Connected,
    Disconnected,
    Dropped,
    Erred,
    ResultLost,
    Submit,
    Unreachable,
    VersionsDiffer,
    WorkerLeft,
    WorkersListed,
)
from workers.dispatch.state import (
    AHEAD,
    DEATHS,
    HANGS,
    LATE_SECONDS,
    SHORTEST_SECONDS,
    STRIKES,
    TASK_SECONDS,
    UNMEASURED,
)
from workers.jobs import Failure


def sizes(tasks: Collection[Submit]) -> list[int]:
    return [len(task.indices) for task in tasks]


# sizes


def test_batches_follow_what_is_expected_and_then_what_was_measured() -> None:
    trial = Trial(2)
    first = trial.ask(1000, seconds=0.05)
    assert sizes(first) == [int(TASK_SECONDS / 0.05)] * 2 * AHEAD
    second = [task for one in first for task in trial.finish(one, per_item=0.01)]
    assert sizes(second) == [int(TASK_SECONDS / 0.01)] * 2 * AHEAD


def test_a_kind_of_work_has_its_own_cost() -> None:
    trial = Trial(1)
    (only,) = trial.ask(1, label="screen island 1")
    trial.finish(only, per_item=0.001)
    screens = trial.ask(1000, label="screen island 2")
    refines = trial.ask(1000, label="refine island 2")
    assert sizes(screens) == [500, 500]
    assert sizes(refines) == [5, 5]


def test_little_work_is_spread_over_all_threads_but_not_thinner_than_worthwhile() -> None:
    assert sizes(Trial(4).ask(12, seconds=0.1)) == [3, 3, 2, 2, 2]
    assert sizes(Trial(64).ask(100, seconds=0.001)) == [100]
    assert SHORTEST_SECONDS / 0.001 > 100


def test_what_takes_long_goes_out_alone() -> None:
    assert sizes(Trial(2).ask(3, seconds=20.0)) == [1, 1, 1]


def test_no_more_goes_out_than_keeps_the_threads_busy() -> None:
    trial = Trial(2)
    first = trial.ask(1000, seconds=1.0)
    assert len(first) == 2 * AHEAD
    assert trial.tick(0.1) == []
    assert len(trial.finish(first[0], per_item=1.0)) == 1


# mishaps


@pytest.mark.parametrize("count", [1, 2, 5, 16, 200])
def test_a_deadly_item_is_found_and_is_the_only_one_given_up(count: int) -> None:
    cluster = SimulatedCluster(workers=2)
    cluster.place(cluster.trial.ask(count, seconds=0.5 / count))
    cluster.run_to_the_end(deadly={count // 2})
    results = cluster.trial.of_job(0)
    assert isinstance(results.pop(count // 2), Failure)
    assert results == {n: n for n in range(count) if n != count // 2}
    assert cluster.deaths <= STRIKES + ceil(log2(count)) + DEATHS
    cluster.trial.require_nothing_left()


def test_what_waited_at_a_worker_that_died_is_not_blamed() -> None:
    cluster = SimulatedCluster(workers=1)
    cluster.place(cluster.trial.ask(8, seconds=1.0))
    cluster.run_to_the_end(deadly={0})
    results = cluster.trial.of_job(0)
    assert [index for index, result in results.items() if isinstance(result, Failure)] == [0]
    assert cluster.deaths == DEATHS


def test_processes_that_die_before_anything_begins_are_not_the_fault_of_an_item() -> None:
    trial = Trial(1, wait_seconds=5.0)
    (first,) = trial.ask(1)
    trial.died("w", first)
    (second,) = trial.handle(Dropped(4.0, first.key, "w"))
    assert second.suspect
    (third,) = trial.handle(Dropped(5.0, second.key, "w"))
    assert trial.stops == []
    assert trial.handle(Dropped(5.1, third.key, "tcp://w")) == []
    (reason,) = trial.stops
    assert reason.startswith(
        "fit: for 5 s worker processes have died before they could begin, the last at tcp://w:"
    )


def test_a_crash_before_the_word_of_the_start_was_out_is_found_out_at_the_next_attempt() -> None:
    trial = Trial(1, wait_seconds=0.5)
    (first,) = trial.ask(1)
    (second,) = trial.handle(Dropped(1.0, first.key, "w"))
    assert trial.stops == []
    assert second.suspect
    for death in range(DEATHS):
        trial.began(second, f"w{death}", 2.0)
        trial.died(f"w{death}", second)
    assert "died" in trial.results[0, 0].reason


@pytest.mark.parametrize("count", [1, 8])
def test_a_hanging_item_is_found_and_given_up(count: int) -> None:
    cluster = SimulatedCluster(workers=2)
    cluster.place(cluster.trial.ask(count, seconds=0.5 / count))
    cluster.run_to_the_end(hanging={0})
    results = cluster.trial.of_job(0)
    failure = results.pop(0)
    assert "did not end within" in failure.reason
    assert f"{HANGS} times" in failure.reason
    assert results == {n: n for n in range(1, count)}
    cluster.trial.require_nothing_left()


def test_work_of_which_nothing_is_measured_gets_more_time_until_something_is() -> None:
    trial = Trial(2)
    slow, quick = trial.ask(2, seconds=1.0)
    trial.began(slow, "w0", 0.0)
    trial.began(quick, "w1", 0.0)
    trial.tick(UNMEASURED * HANG)
    assert slow.key in trial.state.out
    trial.finish(quick)
    trial.tick(UNMEASURED * HANG + 1)
    assert slow.key not in trial.state.out


def test_what_raises_is_tried_three_times_and_costs_the_others_of_its_batch_nothing() -> None:
    tries: Counter[int] = Counter()

    def result(n: int) -> Any:
        tries[n] += 1
        return Raised("KeyError: 'gone'") if n == 3 else n

    cluster = SimulatedCluster(workers=1, result=result)
    cluster.place(cluster.trial.ask(5))
    cluster.run_to_the_end()
    assert cluster.trial.of_job(0) == {0: 0, 1: 1, 2: 2, 3: Failure("raised KeyError: 'gone'"), 4: 4}
    assert tries == {0: 1, 1: 1, 2: 1, 3: RAISES, 4: 1}
    cluster.trial.require_nothing_left()


def test_what_raises_once_is_no_failure() -> None:
    trial = Trial(1)
    (first,) = trial.ask(1)
    (again,) = trial.finish(first, results=[Raised("OSError")])
    assert trial.results == {}
    trial.finish(again)
    assert trial.of_job(0) == {0: 0}
    trial.require_nothing_left()


def test_a_worker_that_leaves_with_notice_is_no_strike() -> None:
    trial = Trial(1)
    (only,) = trial.ask(1)
    for turn in range(2 * DEATHS):
        trial.began(only, f"w{turn}", turn)
        trial.handle(WorkerLeft(turn, f"w{turn}", [only.key], died=False))
    # Nor has what it had begun there run into a limit.
    trial.tick(1e9)
    assert trial.cancelled == []
    trial.finish(only)
    assert trial.of_job(0) == {0: 0}


def test_a_batch_that_fails_as_a_whole_is_tried_twice() -> None:
    trial = Trial(1)
    (first,) = trial.ask(1)
    (second,) = trial.handle(Erred(0.0, first.key, "MemoryError: no room", "worker w0"))
    assert trial.stops == []
    assert trial.handle(Erred(0.0, second.key, "MemoryError: no room", "worker w0")) == []
    assert trial.stops == ["fit: task 0 failed on worker w0: MemoryError: no room"]


def test_bad_input_stops_the_work_at_once_and_in_its_own_words() -> None:
    trial = Trial(1)
    (first,) = trial.ask(1)
    trial.handle(Erred(0.0, first.key, "steel cannot be read", "worker w0", bad_input=True))
    assert trial.stops == ["steel cannot be read (on worker w0)"]


def test_what_is_lost_goes_out_again() -> None:
    trial = Trial(1)
    (first,) = trial.ask(1)
    (second,) = trial.handle(ResultLost(0.0, first.key))
    assert list(second.indices) == [0]
    assert not second.suspect
    trial.finish(first)
    assert trial.results == {}


# what is late


def late_work(threads: int, count: int) -> tuple[Trial, list[Submit]]:
    """A measured kind, and the first task of it begun at worker "w0", at 0."""
    trial = Trial(threads, hang_seconds=1000.0)
    (only,) = trial.ask(1, seconds=1.0)
    trial.finish(only, per_item=1.0)
    out = trial.ask(count, seconds=1.0)
    trial.began(out[0], "w0", 0.0)
    return trial, out


def copies_among(trial: Trial, tasks: Collection[Submit]) -> list[Submit]:
    return [task for task in tasks if len(trial.state.out[task.key].attempts) == 2]


def test_what_is_late_goes_out_once_more_and_no_more_than_once() -> None:
    trial, (slow,) = late_work(threads=2, count=1)
    assert trial.tick(LATE_SECONDS) == []
    (copy,) = trial.tick(LATE_SECONDS + 1)
    assert copies_among(trial, [copy]) == [copy]
    assert copy.indices == slow.indices
    assert copy.workers == ("w1",)
    assert trial.tick(100.0) == []
    trial.began(copy, "w1", 100.0)
    assert trial.tick(200.0) == []
    trial.finish(copy)
    assert trial.of_job(1) == {0: 0}
    assert trial.cancelled == [slow.key]
    trial.finish(slow)
    trial.require_nothing_left()


def test_nothing_goes_out_again_where_no_thread_could_take_it() -> None:
    trial, _ = late_work(threads=1, count=1)
    assert trial.tick(100.0) == []


def test_only_some_threads_repeat_what_is_late_while_other_work_waits() -> None:
    trial, out = late_work(threads=8, count=100)
    for number, task in enumerate(out[1:4]):
        trial.began(task, f"w{number}", 0.0)
    later = trial.tick(6.0)
    copies = copies_among(trial, later)
    assert len(copies) == 2
    assert copies == later[:2]


def test_a_frozen_worker_cannot_take_all_that_goes_out() -> None:
    """Everything out sits at a frozen worker, most of it not begun, while more waits."""
    trial, out = late_work(threads=2, count=100)
    assert len(out) == 2 * AHEAD
    (copy, *more) = trial.tick(6.0)
    trial.began(copy, "w1", 6.5)
    more += trial.finish(copy, per_item=1.0)
    more += trial.tick(7.0)
    repeated = copies_among(trial, more)
    assert repeated
    assert repeated[0].indices in [task.indices for task in out]
    assert len(more) > len(repeated)


def test_work_that_waits_while_all_processes_still_load_is_not_late() -> None:
    trial = Trial(2)
    trial.ask(1000, seconds=1.0)
    assert trial.tick(1000.0) == []


def test_what_still_runs_is_cancelled_where_it_is_needed_no_more() -> None:
    trial, out = late_work(threads=2, count=1)
    (copy,) = trial.tick(10.0)
    trial.finish(copy)
    assert trial.cancelled == [out[0].key]
    more = trial.ask(3)
    trial.handle(Abandoned(11.0))
    assert {task.key for task in more} <= set(trial.cancelled)
    trial.require_nothing_left()


# workers and the scheduler


def test_work_waits_for_workers_but_not_for_ever() -> None:
    trial = Trial(1, wait_seconds=5.0)
    trial.handle(WorkersListed(1.0, {}))
    assert trial.ask(3) == []
    assert trial.tick(6.0) == []
    assert trial.stops == []
    trial.tick(6.1)
    assert trial.stops == [
        "tcp://scheduler:1 with no workers for 5 s, with 3 pieces of work outstanding: start some, then start"
        " again; what was stored is kept"
    ]
    assert trial.handle(WorkersListed(7.0, {"new": 1}))
    assert [record.detail for record in trial.records] == ["1 left, 0 there", "1 joined, 1 there"]


def test_a_worker_of_another_version_gets_no_work() -> None:
    trial = Trial(2)
    trial.handle(VersionsDiffer(0.0, {"w0": "has tool 1"}))
    assert [task.workers for task in trial.ask(2, seconds=1.0)] == [("w1",)] * 2
    trial.handle(VersionsDiffer(0.0, {"w0": "has tool 1"}))
    assert [record.detail for record in trial.records] == ["worker w0 has tool 1; it gets no work"]


def test_a_task_that_a_worker_of_another_version_got_is_no_error_of_the_task() -> None:
    trial = Trial(2)
    (task,) = trial.ask(1)
    for _ in range(3):
        (task,) = trial.handle(Erred(0.0, task.key, "cannot", "w0", faults={"w0": "has tool 1"}))
        assert task.workers == ("w1",)
    assert trial.stops == []


def test_nothing_is_lost_with_the_scheduler() -> None:
    trial = Trial(2, wait_seconds=5.0)
    tasks = trial.ask(4, seconds=1.0)
    assert trial.handle(Disconnected(1.0)) == []
    assert trial.handle(Unreachable(2.0, "no answer")) == []
    again = trial.handle(Connected(3.0, {"new": 1}, {}))
    assert [task.indices for task in again] == [task.indices for task in tasks]
    assert not any(task.suspect for task in again)
    assert [record.detail for record in trial.records] == [
        "lost the connection to tcp://scheduler:1 with 2 workers",
        "back after 2 s: tcp://scheduler:1 with 1 worker",
    ]


def test_a_scheduler_that_stays_away_ends_the_work() -> None:
    trial = Trial(2, wait_seconds=5.0)
    trial.ask(4, seconds=1.0)
    trial.handle(Disconnected(1.0))
    trial.handle(Connected(2.0, {"new": 1}, {"new": "has tool 1"}))
    assert trial.stops == []
    trial.handle(Unreachable(6.1, "no answer"))
    assert trial.stops == [
        "lost the connection to tcp://scheduler:1 with 2 workers with 4 pieces of work outstanding: no answer;"
        " what was stored is kept"
    ]
