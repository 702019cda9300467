"""A run goes on, and comes to the same results, whatever happens to real workers and a real scheduler."""

from __future__ import annotations

import os
import re
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from distributed import LocalCluster

from tests.workers import work
from tests.workers.cluster import Cluster, changing_cluster
from tests.workers.work import results_of
from workers import DaskSettings, Executor, Failure, Job, WorkersError, open_executor
from workers.dispatch.state import DEATHS, HANGS

SQUARES = {n: n * n for n in range(40)}


def squares(milliseconds: int = 100) -> Job:
    items = [(n, milliseconds / 1000) for n in SQUARES]
    return Job(work.square_slowly, work.RECIPE, items, "square", milliseconds / 1000)


@pytest.fixture(scope="module")
def lasting_cluster() -> Iterator[Cluster]:
    """Whose workers may be killed: their nannies start others."""
    with changing_cluster(workers=2) as cluster:
        yield cluster


@pytest.fixture
def mortal_cluster(lasting_cluster: Cluster) -> Iterator[Cluster]:
    """The same for a test that leaves its scheduler or workers in disorder."""
    yield lasting_cluster
    lasting_cluster.repair(workers=2)


@pytest.fixture(scope="module")
def small_cluster() -> Iterator[Cluster]:
    """Of workers with little memory."""
    with changing_cluster(workers=0) as cluster:
        cluster.start_workers(2, "--memory-limit", "300MB")
        yield cluster


def opened(cluster: Cluster, wait_seconds: float = 30.0, hang_seconds: float = 60.0) -> Any:
    settings = DaskSettings(cluster.address, wait_seconds=wait_seconds, hang_seconds=hang_seconds)
    return open_executor(settings, package="gpsearch")


def some_results(executor: Executor, count: int) -> dict[int, Any]:
    results: dict[int, Any] = {}
    while len(results) < count:
        assert executor.outstanding
        results |= {done.index: done.result for done in executor.wait(5.0)}
    return results


def the_rest(executor: Executor, results: dict[int, Any], log: list[str] | None = None) -> dict[int, Any]:
    """All results; notes incidents as they happen, where there is a log."""
    while executor.outstanding:
        for done in executor.wait(5.0):
            assert done.index not in results
            results[done.index] = done.result
        if log is not None:
            log += [f"{incident.kind}: {incident.detail}" for incident in executor.incidents()]
    return results


def processes(executor: Executor) -> list[int]:
    """Of the workers; both have something to do, since neither ends before both have begun."""
    results = results_of(executor, Job(work.process_after, work.RECIPE, [0.3] * 8, "processes", 0.5))
    return sorted({process for process, _ in results.values()})


# workers


def test_workers_killed_in_mid_task_again_and_again_change_nothing(lasting_cluster: Cluster) -> None:
    with opened(lasting_cluster) as executor:
        executor.submit(Job(work.square_and_process, work.RECIPE, [(n, 0.2) for n in SQUARES], "square", 0.2))
        results: dict[int, Any] = {}
        killed: list[int] = []
        while executor.outstanding:
            for done in executor.wait(5.0):
                assert done.index not in results
                results[done.index], process = done.result
                if process not in killed and len(killed) < 4:
                    killed.append(process)
                    os.kill(process, signal.SIGKILL)
        assert results == SQUARES
        assert len(killed) == 4
        assert {"workers", "retry"} <= {incident.kind for incident in executor.incidents()}


@pytest.mark.long
def test_all_workers_leave_and_others_join() -> None:
    with changing_cluster(workers=0) as cluster:
        first = cluster.start_workers(2)
        with opened(cluster) as executor:
            executor.submit(squares())
            results = some_results(executor, 4)
            first.kill()
            log: list[str] = []
            while not any("0 there" in line for line in log):
                results |= {done.index: done.result for done in executor.wait(0.2)}
                log += [incident.detail for incident in executor.incidents()]
            assert executor.processes == 1
            assert executor.description.endswith("with no workers")
            cluster.start_workers(1)
            assert the_rest(executor, results, log) == SQUARES
            assert any(re.fullmatch(r"workers: 1 joined, 1 there", line) for line in log)


def test_no_workers_for_too_long_end_the_run() -> None:
    with changing_cluster(workers=0) as cluster:
        first = cluster.start_workers(1)
        with opened(cluster, wait_seconds=1.0) as executor:
            executor.submit(squares())
            results = some_results(executor, 1)
            first.kill()
            expected = (
                rf"{cluster.address} with no workers for 1 s, with \d+ pieces of work outstanding: start some"
            )
            with pytest.raises(WorkersError, match=expected):
                the_rest(executor, results)


def test_the_work_of_a_frozen_worker_is_taken_over(lasting_cluster: Cluster) -> None:
    with opened(lasting_cluster) as executor:
        frozen = processes(executor)[0]
        executor.submit(squares())
        results = some_results(executor, 2)
        os.kill(frozen, signal.SIGSTOP)
        try:
            assert the_rest(executor, results) == SQUARES
        finally:
            os.kill(frozen, signal.SIGCONT)


def test_a_slow_worker_slows_only_its_own_tasks(mortal_cluster: Cluster, tmp_path: Path) -> None:
    """One that takes a minute for what takes others a tenth of a second: another one does it meanwhile."""
    with opened(mortal_cluster) as executor:
        results_of(executor, squares(10))
        items = [(str(tmp_path / "marker"), n) for n in range(10)]
        job = Job(work.slow_at_first, work.RECIPE, items, "square", 0.1)
        assert results_of(executor, job) == {n: n * n for n in range(10)}


def test_a_worker_of_another_version_that_joins_gets_no_work(mortal_cluster: Cluster, tmp_path: Path) -> None:
    work.fake_version(tmp_path, "0.0.7")
    with opened(mortal_cluster) as executor:
        executor.submit(squares(300))
        results = some_results(executor, 1)
        mortal_cluster.start_workers(1, python_path=tmp_path)
        log: list[str] = []
        assert the_rest(executor, results, log) == SQUARES
        [refusal] = [line for line in log if line.startswith("refused")]
        assert re.search(
            r"worker tcp://\S+ has gpsearch 0\.0\.7, this process \S+: install .*; it gets no", refusal
        )
        assert executor.processes == 2


# items


@pytest.mark.parametrize(
    ("function", "hang_seconds", "reason"),
    [
        (work.eat_memory, 60.0, f"its worker process died, {DEATHS} times"),
        (work.hang_with_the_lock, 1.0, f"did not end within 1 s, {HANGS} times"),
    ],
)
@pytest.mark.long
def test_a_deadly_item_is_given_up_alone(
    small_cluster: Cluster, function: Callable[..., Any], hang_seconds: float, reason: str
) -> None:
    with opened(small_cluster, hang_seconds=hang_seconds) as executor:
        assert results_of(executor, Job(function, work.RECIPE, range(4), "item", 0.01)) == {n: n for n in range(4)}
        results = results_of(executor, Job(function, work.RECIPE, [0, 1, None, 3], "item", 0.01))
        failure = results.pop(2)
        assert isinstance(failure, Failure)
        assert reason in failure.reason
        assert results == {0: 0, 1: 1, 3: 3}
        # What hung was ended, so that every worker can work again.
        while len(processes(executor)) < 2:
            pass


# the scheduler


@pytest.mark.long
def test_a_scheduler_that_is_restarted_loses_nothing(mortal_cluster: Cluster) -> None:
    with opened(mortal_cluster) as executor:
        executor.submit(squares())
        results = some_results(executor, 4)
        restart = threading.Thread(
            target=lambda: (mortal_cluster.restart_scheduler(), mortal_cluster.start_workers(2))
        )
        restart.start()
        log: list[str] = []
        assert the_rest(executor, results, log) == SQUARES
        restart.join()
        lost, back = (line for line in log if line.startswith("scheduler"))
        assert re.fullmatch(rf"scheduler: lost the connection to {mortal_cluster.address} with 2 workers", lost)
        assert re.match(rf"scheduler: back after \d+ s: {mortal_cluster.address} with \d+ worker", back)


def test_work_may_be_asked_for_while_the_scheduler_is_away(mortal_cluster: Cluster) -> None:
    with opened(mortal_cluster) as executor:
        assert results_of(executor, squares(10)) == SQUARES
        mortal_cluster.scheduler.kill()
        executor.submit(squares(20))
        mortal_cluster.start_scheduler(port=mortal_cluster.address.rsplit(":", 1)[1])
        mortal_cluster.start_workers(1)
        assert the_rest(executor, {}) == SQUARES


def test_a_scheduler_away_for_too_long_ends_the_run(mortal_cluster: Cluster) -> None:
    with opened(mortal_cluster, wait_seconds=2.0) as executor:
        executor.submit(squares())
        results = some_results(executor, 1)
        mortal_cluster.scheduler.kill()
        expected = (
            rf"^lost the connection to {mortal_cluster.address} with 2 workers"
            r" with \d+ pieces of work outstanding: no Dask scheduler answers"
        )
        with pytest.raises(WorkersError, match=expected):
            the_rest(executor, results)


def test_an_adaptive_cluster_grows_and_shrinks_under_the_work() -> None:
    """Dask's own rules start workers while there is work and retire them when there is none."""
    with LocalCluster(n_workers=0, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster:
        cluster.adapt(minimum=1, maximum=3, interval="100 ms", wait_count=2, target_duration="500 ms")
        with open_executor(DaskSettings(cluster.scheduler_address, wait_seconds=30)) as executor:
            for n in range(2):
                job = Job(work.square_slowly, work.RECIPE, [(i, 0.05) for i in range(60)], f"wave {n}", 0.05)
                assert work.results_of(executor, job) == {i: i**2 for i in range(60)}
                while len(cluster.scheduler_info["workers"]) > 1:
                    time.sleep(0.05)
            told = [incident.detail for incident in executor.incidents() if incident.kind == "workers"]
        assert any("joined" in detail for detail in told)
        assert any("left" in detail for detail in told)
