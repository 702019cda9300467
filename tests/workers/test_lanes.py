"""Lanes share an executor and do not wait for each other."""

from collections.abc import Iterator
from typing import Any

import pytest

from tests.workers import work
from workers import Done, Incident, Job, Lane, Stopped, WorkersError, run_lanes
from workers.local import LocalExecutor


def job(label: str, count: int) -> Job:
    return Job(work.square, work.RECIPE, range(count), label)


class Script:
    """An executor that gives results as a script says: job labels and indices, one wait after the other."""

    description = "a script"
    processes = 1

    def __init__(self, *waits: list[tuple[str, int]] | BaseException) -> None:
        self.waits = list(waits)
        self.jobs: dict[str, Job] = {}
        self.abandoned = False

    @property
    def outstanding(self) -> int:
        return len(self.waits)

    def submit(self, job: Job) -> None:
        self.jobs[job.label] = job

    def wait(self, seconds: float) -> list[Done]:
        results = self.waits.pop(0)
        if isinstance(results, BaseException):
            raise results
        return [Done(self.jobs[label], index, f"{label}/{index}") for label, index in results]

    def abandon(self) -> None:
        self.abandoned = True

    def incidents(self) -> list[Incident]:
        return []

    def close(self) -> None: ...


def course(seen: list[Any], *labels: str) -> Lane:
    """A lane of jobs with two items each; notes results, and what it had when it was stopped."""
    try:
        for label in labels:
            seen.append((yield job(label, 2)))
    except Stopped as stopped:
        seen.append(stopped.results)


def run(executor: Any, *lanes: Lane, stop: Iterator[bool] | None = None) -> tuple[bool, list[Done]]:
    done: list[Done] = []
    finished = run_lanes(executor, lanes, done=done.append, stop=lambda: next(stop) if stop else False)
    return finished, done


def test_a_lane_goes_on_while_another_one_waits() -> None:
    slow: list[Any] = []
    fast: list[Any] = []
    script = Script([("fast1", 0), ("slow", 0)], [("fast1", 1)], [("fast2", 0), ("fast2", 1)], [("slow", 1)])
    finished, done = run(script, course(slow, "slow"), course(fast, "fast1", "fast2"))
    assert finished
    assert slow == [["slow/0", "slow/1"]]
    assert fast == [["fast1/0", "fast1/1"], ["fast2/0", "fast2/1"]]
    assert [result.job.label for result in done] == ["fast1", "slow", "fast1", "fast2", "fast2", "slow"]


def test_results_come_in_the_order_of_items() -> None:
    seen: list[Any] = []
    run(Script([("a", 1), ("a", 0)]), course(seen, "a"))
    assert seen == [["a/0", "a/1"]]


def test_jobs_without_items_are_over_at_once() -> None:
    seen: list[Any] = []

    def lane() -> Lane:
        seen.append((yield job("nothing", 0)))
        seen.append((yield job("something", 2)))
        seen.append((yield job("nothing", 0)))

    assert run(LocalExecutor(), lane())[0]
    assert seen == [[], [0, 1], []]


def test_lanes_that_ask_for_nothing() -> None:
    assert run(LocalExecutor(), course([]), course([])) == (True, [])


def test_lanes_are_stopped_with_what_there_is() -> None:
    early: list[Any] = []
    late: list[Any] = []
    script = Script([("a", 1), ("b", 0), ("b", 1)])
    finished, _ = run(script, course(early, "a"), course(late, "b", "c"), stop=iter([False, True]))
    assert not finished
    assert script.abandoned
    assert early == [{1: "a/1"}]
    assert late == [["b/0", "b/1"], {}]


@pytest.mark.parametrize("error", [WorkersError("no workers"), KeyboardInterrupt()])
def test_an_error_stops_every_lane(error: BaseException) -> None:
    one: list[Any] = []
    other: list[Any] = []
    script = Script([("a", 0)], error)
    with pytest.raises(type(error)):
        run(script, course(one, "a"), course(other, "b"))
    assert script.abandoned
    assert (one, other) == ([{0: "a/0"}], [{}])


def test_an_error_of_one_lane_reaches_the_others() -> None:
    seen: list[Any] = []

    def broken() -> Lane:
        yield job("broken", 2)
        raise OSError("disk full")

    script = Script([("broken", 0), ("broken", 1), ("a", 1)])
    with pytest.raises(OSError, match="disk full"):
        run(script, broken(), course(seen, "a"))
    assert seen == [{1: "a/1"}]


def test_a_lane_that_fails_to_save_keeps_no_other_from_it() -> None:
    one: list[Any] = []
    other: list[Any] = []

    def careless() -> Lane:
        try:
            yield job("careless", 2)
        except Stopped:
            raise OSError("disk full") from None

    with pytest.raises(OSError, match="disk full"):
        run(Script(), course(one, "a"), careless(), course(other, "b"), stop=iter([True]))
    assert (one, other) == ([{}], [{}])


def test_stopped_may_pass_through_a_lane() -> None:
    def heedless() -> Lane:
        yield job("heedless", 2)

    assert not run(Script(), heedless(), stop=iter([True]))[0]
