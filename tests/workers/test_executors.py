"""What every executor promises: this process, processes of this machine, and a running cluster alike."""

from collections.abc import Iterator

import pytest

from fitters.errors import FittersError
from tests.workers import work
from tests.workers.cluster import real_cluster
from workers import DaskSettings, Executor, LocalSettings, WorkersError, open_executor


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


def test_every_payload_gives_its_result_once(executor: Executor) -> None:
    results = list(executor.run(work.combine, work.RECIPE, range(50), label="fit island2 generation7"))
    assert sorted(results) == [(n, ("context of tests", n**2)) for n in range(50)]


def test_no_payloads_give_no_results(executor: Executor) -> None:
    assert list(executor.run(work.combine, work.RECIPE, [], label="nothing")) == []


def test_a_process_builds_its_context_once(executor: Executor) -> None:
    seen = [pair for _, pair in executor.run(work.process_and_builds, work.RECIPE, range(20), label="builds")]
    assert {builds for _, builds in seen} == {1}
    assert len({process for process, _ in seen}) == executor.processes


def test_description_counts_the_processes(executor: Executor) -> None:
    expected = {1: "this process", 2: "2 worker processes on this machine"}
    if "tcp://" in executor.description:
        assert executor.description.endswith(" with 2 workers")
    else:
        assert executor.description == expected[executor.processes]


def test_a_failing_function_is_named_with_its_task(executor: Executor) -> None:
    with pytest.raises(WorkersError, match=r"risky: task 3 failed on .*: KeyError: 'no such thing'") as caught:
        list(executor.run(work.fail_at_three, work.RECIPE, range(6), label="risky"))
    assert isinstance(caught.value.__cause__, KeyError)


def test_bad_input_keeps_its_message_and_names_the_place(executor: Executor) -> None:
    with pytest.raises(WorkersError, match=r"^/far/steel cannot be read: mount it there \(on .+\)$") as caught:
        list(executor.run(work.reject, work.RECIPE, ["/far/steel"], label="fit"))
    assert isinstance(caught.value.__cause__, FittersError)


def test_an_executor_works_on_after_a_failure(executor: Executor) -> None:
    with pytest.raises(WorkersError):
        list(executor.run(work.fail_at_three, work.RECIPE, [3], label="risky"))
    assert list(executor.run(work.combine, work.RECIPE, [4], label="fine")) == [(0, ("context of tests", 16))]
