"""What every executor promises: this process, processes of this machine, and a running cluster alike."""

from collections.abc import Iterable, Iterator
from typing import Any

import pytest

from fitters.errors import FittersError
from tests.workers import work
from tests.workers.cluster import real_cluster
from tests.workers.work import results
from workers import DaskSettings, Executor, Failure, Job, LocalSettings, Recipe, WorkersError, open_executor


@pytest.fixture(scope="module", params=["local", "processes", "cluster"])
def executor(request: pytest.FixtureRequest) -> Iterator[Executor]:
    match request.param:
        case "local":
            with open_executor(LocalSettings()) as executor:
                yield executor
        case "processes":
            with open_executor(DaskSettings(workers=2)) as executor:
                yield executor
        case "cluster":
            with (
                real_cluster(workers=2) as address,
                open_executor(DaskSettings(address, wait_seconds=20)) as executor,
            ):
                yield executor


def job(function: Any, items: Iterable[Any], label: str = "fit island2 generation7", seconds: float = 0.01) -> Job:
    return Job(function, work.RECIPE, tuple(items), label, seconds)


def test_every_item_gives_its_result_once(executor: Executor) -> None:
    found = results(executor, job(work.combine, range(50)))
    assert found == {n: ("context of tests", n**2) for n in range(50)}


def test_jobs_are_told_apart(executor: Executor) -> None:
    jobs = [job(work.square, range(first, first + 3), label=f"fit {first}") for first in (10, 20)]
    for one in jobs:
        executor.submit(one)
    assert executor.outstanding == 6
    found: dict[tuple[str, int], int] = {}
    while executor.outstanding:
        for done in executor.wait(5.0):
            found[done.job.label, done.index] = done.result
    assert found == {(f"fit {first}", n): (first + n) ** 2 for first in (10, 20) for n in range(3)}


def test_no_items_give_no_results(executor: Executor) -> None:
    assert results(executor, job(work.combine, [])) == {}
    assert executor.outstanding == 0
    assert executor.wait(60.0) == []


def test_a_process_builds_its_context_once(executor: Executor) -> None:
    seen = list(results(executor, job(work.process_and_builds, range(40), label="builds", seconds=0.2)).values())
    assert {builds for _, builds in seen} == {1}
    assert len({process for process, _ in seen}) == executor.processes


def test_description_counts_the_processes(executor: Executor) -> None:
    expected = {1: "this process", 2: "2 worker processes on this machine"}
    if "tcp://" in executor.description:
        assert executor.description.endswith(" with 2 workers")
    else:
        assert executor.description == expected[executor.processes]


def test_what_raises_fails_alone(executor: Executor) -> None:
    found = results(executor, job(work.fail_at_three, range(6)))
    assert found.pop(3) == Failure("raised KeyError: 'no such thing'")
    assert found == {n: n for n in (0, 1, 2, 4, 5)}


def test_bad_input_keeps_its_message_and_names_the_place(executor: Executor) -> None:
    with pytest.raises(WorkersError, match=r"^/far/steel cannot be read: mount it there \(on .+\)$") as caught:
        results(executor, job(work.reject, ["/far/steel"]))
    assert isinstance(caught.value.__cause__, FittersError)
    executor.abandon()


def test_a_context_that_cannot_be_built_ends_the_run_and_names_the_place(executor: Executor) -> None:
    unbuildable = Job(work.square, Recipe(work.build_badly, "it"), (1,), "fit", 0.01)
    place = r"(this process|worker tcp://.+)"
    with pytest.raises(WorkersError, match=rf"^fit: task 0 failed on {place}: MemoryError: no room for it$"):
        results(executor, unbuildable)
    executor.abandon()


def test_what_is_abandoned_gives_no_results(executor: Executor) -> None:
    executor.submit(job(work.square, range(30), seconds=1.0))
    executor.wait(5.0)
    executor.abandon()
    assert executor.outstanding == 0
    assert results(executor, job(work.square, [5])) == {0: 25}


def test_an_executor_works_on_after_a_failure(executor: Executor) -> None:
    with pytest.raises(WorkersError):
        results(executor, job(work.reject, ["anything"]))
    executor.abandon()
    assert results(executor, job(work.combine, [4])) == {0: ("context of tests", 16)}
