"""What every executor promises, as tests for pytest."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest

from fitters.errors import FittersError
from workers.context import Recipe
from workers.errors import WorkersError
from workers.executor import Executor, ExecutorSettings, open_executor
from workers.jobs import Failure, Job
from workers.testing import functions
from workers.testing.functions import results_of


def job(function: Callable[..., Any], items: Iterable[Any], label: str = "fit", seconds: float = 0.01) -> Job:
    return Job(function, functions.RECIPE, tuple(items), label, seconds)


class ExecutorContract:
    """Each test takes a fixture `executor`, which is open, or `settings`, which can be opened.

    Settings of an executor whose processes may crash or hang without harm to the launcher have `hang_seconds`; the
    fixtures set it to 1.
    """

    def test_every_item_gives_its_result_once(self, executor: Executor) -> None:
        results = results_of(executor, job(functions.combine, range(50)))
        assert results == {n: ("context of tests", n**2) for n in range(50)}

    def test_results_belong_to_their_jobs(self, executor: Executor) -> None:
        jobs = [job(functions.square, range(first, first + 3), label=f"fit {first}") for first in (10, 20)]
        for one in jobs:
            executor.submit(one)
        assert executor.outstanding == 6
        results: dict[tuple[str, int], int] = {}
        while executor.outstanding:
            for done in executor.wait(5.0):
                results[done.job.label, done.index] = done.result
        assert results == {(f"fit {first}", n): (first + n) ** 2 for first in (10, 20) for n in range(3)}

    def test_no_items_give_no_results(self, executor: Executor) -> None:
        assert results_of(executor, job(functions.combine, [])) == {}
        assert executor.outstanding == 0
        assert executor.wait(60.0) == []

    def test_a_process_builds_its_context_once(self, executor: Executor) -> None:
        asked = job(functions.process_and_builds, range(40), label="builds", seconds=0.2)
        results = results_of(executor, asked).values()
        assert {builds for _, builds in results} == {1}
        assert len({process for process, _ in results}) == executor.processes

    def test_it_says_where_the_work_runs(self, executor: Executor) -> None:
        assert executor.description
        assert executor.processes >= 1
        assert executor.processes == 1 or str(executor.processes) in executor.description

    def test_what_raises_fails_alone(self, executor: Executor) -> None:
        results = results_of(executor, job(functions.fail_at_three, range(6)))
        assert results.pop(3) == Failure("raised KeyError: 'no such thing'")
        assert results == {n: n for n in (0, 1, 2, 4, 5)}

    def test_bad_input_keeps_its_message_and_names_the_place(self, executor: Executor) -> None:
        message = r"^/far/steel cannot be read: mount it there \(on .+\)$"
        with pytest.raises(WorkersError, match=message) as caught:
            results_of(executor, job(functions.reject, ["/far/steel"]))
        assert isinstance(caught.value.__cause__, FittersError)
        executor.abandon()

    def test_a_context_that_cannot_be_built_ends_the_run_and_names_the_place(self, executor: Executor) -> None:
        unbuildable = Job(functions.square, Recipe(functions.build_badly, "it"), (1,), "fit", 0.01)
        place = "(this process|worker .+)"
        with pytest.raises(WorkersError, match=rf"^fit: task 0 failed on {place}: MemoryError: no room for it$"):
            results_of(executor, unbuildable)
        executor.abandon()

    def test_what_is_abandoned_gives_no_results(self, executor: Executor) -> None:
        executor.submit(job(functions.square, range(30), seconds=1.0))
        executor.wait(5.0)
        executor.abandon()
        assert executor.outstanding == 0
        assert results_of(executor, job(functions.square, [5])) == {0: 25}

    def test_it_works_on_after_a_failure(self, executor: Executor) -> None:
        with pytest.raises(WorkersError):
            results_of(executor, job(functions.reject, ["anything"]))
        executor.abandon()
        assert results_of(executor, job(functions.combine, [4])) == {0: ("context of tests", 16)}

    @pytest.mark.parametrize(
        ("function", "reason"), [(functions.crash, "process died"), (functions.hang, "did not end within 1 s")]
    )
    def test_what_ends_a_process_or_never_ends_fails_alone(
        self, executor: Executor, settings: ExecutorSettings, function: Callable[..., Any], reason: str
    ) -> None:
        if not hasattr(settings, "hang_seconds"):
            pytest.skip(f"{executor.description} has no process that may be lost")
        before = len(_processes(executor))
        assert results_of(executor, job(function, range(4), "item")) == {n: n for n in range(4)}
        results = results_of(executor, job(function, [0, 1, None, 3], "item"))
        failure = results.pop(2)
        assert isinstance(failure, Failure)
        assert reason in failure.reason
        assert results == {0: 0, 1: 1, 3: 3}
        # Another process takes the place of each that was lost.
        while len(_processes(executor)) < before:
            pass

    def test_another_one_can_be_opened_and_closed(self, executor: Executor, settings: ExecutorSettings) -> None:
        with open_executor(settings) as other:
            assert results_of(other, job(functions.square, [3])) == {0: 9}
        assert results_of(executor, job(functions.square, [4])) == {0: 16}


def _processes(executor: Executor) -> set[int]:
    asked = job(functions.process_and_builds, range(40), label="builds", seconds=0.2)
    return {process for process, _ in results_of(executor, asked).values()}
