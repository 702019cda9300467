"""What can go wrong with a cluster, with a real one."""

import importlib.metadata
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import dask.config
import pytest
from dask.utils import key_split

from tests.workers import work
from tests.workers.cluster import ROOT, changing_cluster, real_cluster
from tests.workers.work import results_of
from workers import DaskSettings, Executor, Job, WorkersError, open_executor
from workers.dask.executor import key_prefix


@pytest.fixture(scope="module")
def one_process() -> Iterator[Executor]:
    """An executor of one worker process, which lasts."""
    with open_executor(DaskSettings(workers=1)) as executor:
        yield executor


def open_and_fail(settings: DaskSettings) -> str:
    with pytest.raises(WorkersError) as caught, open_executor(settings, package="gpsearch"):
        pass
    return str(caught.value)


def test_no_scheduler() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        message = open_and_fail(DaskSettings(address, wait_seconds=0.5))
    assert message == (
        f"no Dask scheduler answers at {address} after 0.5 s: "
        "start one with `dask-scheduler`, or set executor: local"
    )


def test_a_server_that_is_no_scheduler_and_says_nothing() -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        assert "no Dask scheduler answers" in open_and_fail(DaskSettings(address, wait_seconds=0.5))


@pytest.mark.parametrize("address", ["", "host", "host:8786", "tcp://host", "http://host:80", "tcp://h:99999"])
def test_malformed_address(address: str) -> None:
    assert f"{address!r} is not the address of a Dask scheduler" in open_and_fail(DaskSettings(address))


def test_scheduler_without_workers() -> None:
    with real_cluster(workers=0) as address:
        message = open_and_fail(DaskSettings(address, wait_seconds=1))
    assert message == (
        f"the Dask scheduler at {address} has no workers after 1 s: start some with `dask-worker {address}`"
    )


def test_zero_processes() -> None:
    assert "ask for at least 1" in open_and_fail(DaskSettings(workers=0))


def test_another_version_is_refused(tmp_path: Path) -> None:
    work.fake_version(tmp_path, "0.0.7")
    with real_cluster(workers=1, python_path=tmp_path) as address:
        message = open_and_fail(DaskSettings(address, wait_seconds=20))
    ours = importlib.metadata.version("gpsearch")
    assert message.startswith("worker tcp://")
    assert message.endswith(f"has gpsearch 0.0.7, this process {ours}: install the same version on both")


def test_one_foreign_worker_among_others_gets_no_work(tmp_path: Path) -> None:
    work.fake_version(tmp_path, "0.0.7")
    with changing_cluster(workers=1) as cluster:
        cluster.start_workers(1, python_path=tmp_path)
        with open_executor(DaskSettings(cluster.address, wait_seconds=20), package="gpsearch") as executor:
            [incident] = executor.incidents()
            assert incident.kind == "refused"
            assert "has gpsearch 0.0.7" in incident.detail
            assert executor.processes == 1
            assert results_of(executor, Job(work.square, work.RECIPE, range(9), "fit")) == {
                n: n * n for n in range(9)
            }


def test_worker_processes_compute_with_one_thread(one_process: Executor) -> None:
    names = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"]
    job = Job(work.environment, work.RECIPE, names, "env")
    assert set(results_of(one_process, job).values()) == {"1"}


def test_an_interrupt_does_not_reach_worker_processes(one_process: Executor) -> None:
    before = results_of(one_process, Job(work.process_and_builds, work.RECIPE, [0], "before"))
    results_of(one_process, Job(work.interrupt_own_process, work.RECIPE, [None], "interrupt"))
    after = results_of(one_process, Job(work.process_and_builds, work.RECIPE, [0], "after"))
    assert after == before


def test_what_is_abandoned_does_not_start(one_process: Executor, tmp_path: Path) -> None:
    items = [(str(tmp_path / str(n)), 0.2) for n in range(20)]
    one_process.submit(Job(work.mark_and_wait, work.RECIPE, items, "slow"))
    one_process.wait(20.0)
    one_process.abandon()
    # The one process starts this only after what the cancellation left of the work before.
    assert results_of(one_process, Job(work.square, work.RECIPE, [2], "next")) == {0: 4}
    assert len(list(tmp_path.iterdir())) < len(items)


def test_processes_that_stay_away_fail_the_run() -> None:
    with open_executor(DaskSettings(workers=1, wait_seconds=1)) as executor:
        expected = r"^no worker processes on this machine for 1 s, with 1 pieces of work outstanding"
        with pytest.raises(WorkersError, match=expected):
            results_of(executor, Job(work.leave_for_good, work.RECIPE, [None], "lonely"))


def test_a_process_is_restarted_long_after_its_first_death(tmp_path: Path) -> None:
    hasty = dask.config.set({"distributed.deploy.lost-worker-timeout": "0.1 s"})
    with hasty, open_executor(DaskSettings(workers=1)) as executor:
        for death in range(2):
            job = Job(work.die_once, work.RECIPE, [str(tmp_path / str(death))], "fit")
            assert results_of(executor, job) == {0: "survived"}


INTERRUPTED = """
import faulthandler
from tests.workers import work
from workers import DaskSettings, Job, open_executor
if __name__ == "__main__":
    faulthandler.dump_traceback_later(80)
    try:
        with open_executor(DaskSettings(workers=2)) as executor:
            items = [("/dev/null", seconds) for seconds in (0, 300, 300)]
            executor.submit(Job(work.mark_and_wait, work.RECIPE, items, "slow"))
            while not executor.wait(10.0):
                pass
            print("running", flush=True)
            executor.wait(300.0)
    except KeyboardInterrupt:
        print("stopped", flush=True)
"""


def test_interrupt_leaves_nothing_on_the_terminal(tmp_path: Path) -> None:
    script = tmp_path / "interrupted.py"
    script.write_text(INTERRUPTED)
    launcher = subprocess.Popen(
        [sys.executable, script],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    assert launcher.stdout is not None
    assert launcher.stdout.readline() == "running\n"
    os.killpg(launcher.pid, signal.SIGINT)
    # It took more than 30 s once, on a busy machine. Where it waits for 80 s, it prints its stack.
    assert launcher.communicate(timeout=90)[0] == "stopped\n"
    assert launcher.returncode == 0


QUIET = """
from tests.workers import work
from workers import DaskSettings, Job, open_executor
if __name__ == "__main__":
    with open_executor(DaskSettings(workers=1, hang_seconds=0.5)) as executor:
        work.results_of(executor, Job(work.chatter, work.RECIPE, [None], "job", 0.01))
        for function in (work.hang, work.crash):
            executor.submit(Job(function, work.RECIPE, [None], "job", 0.01))
            while not any(incident.kind == "lost" for incident in executor.incidents()):
                executor.wait(0.1)
            executor.abandon()
"""


@pytest.mark.long
def test_mishaps_leave_nothing_on_the_terminal(tmp_path: Path) -> None:
    script = tmp_path / "quiet.py"
    script.write_text(QUIET)
    launcher = subprocess.run(
        [sys.executable, script],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=120,
    )
    assert (launcher.stdout, launcher.returncode) == ("", 0)


@pytest.mark.parametrize(
    ("label", "prefix"),
    [
        ("screen island 2 generation 7", "screen-island"),
        ("fit-island2", "fit"),
        ("2nd", "task"),
        ("", "task"),
        ("\N{GREEK SMALL LETTER ALPHA} fit", "fit"),
    ],
)
def test_the_dashboard_groups_tasks_by_what_they_do(label: str, prefix: str) -> None:
    assert key_split((f"{key_prefix(label)}-{uuid4().hex}", 12)) == prefix
