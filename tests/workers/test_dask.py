"""What can go wrong with a cluster, with a real one."""

import importlib.metadata
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import dask.config
import pytest

from tests.workers import work
from tests.workers.cluster import ROOT, real_cluster
from workers import DaskSettings, WorkersError, open_executor
from workers.dask_executor import key_prefix


def open_and_fail(settings: DaskSettings) -> str:
    with pytest.raises(WorkersError) as caught, open_executor(settings):
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
    metadata = tmp_path / "gpsearch-0.0.7.dist-info" / "METADATA"
    metadata.parent.mkdir()
    metadata.write_text("Metadata-Version: 2.1\nName: gpsearch\nVersion: 0.0.7\n")
    with real_cluster(workers=1, python_path=tmp_path) as address:
        message = open_and_fail(DaskSettings(address, wait_seconds=20))
    ours = importlib.metadata.version("gpsearch")
    assert message.startswith("worker tcp://")
    assert message.endswith(f"has gpsearch 0.0.7, this process {ours}: install the same version on both")


def test_a_killed_worker_loses_nothing_and_a_deadly_task_is_named(tmp_path: Path) -> None:
    with open_executor(DaskSettings(workers=2)) as executor:
        marker = str(tmp_path / "died")
        results = list(executor.run(work.die_once, work.RECIPE, [marker] * 4, label="fit"))
        assert sorted(results) == [(n, "survived") for n in range(4)]
        assert Path(marker).exists()
        with pytest.raises(WorkersError, match=r"deadly: task 0 was given up after \d+ worker processes died"):
            list(executor.run(work.die, work.RECIPE, [None], label="deadly"))


def test_processes_that_stay_away_fail_the_run() -> None:
    with open_executor(DaskSettings(workers=1, wait_seconds=1)) as executor:
        results = executor.run(work.leave_for_good, work.RECIPE, [None], label="lonely")
        with pytest.raises(WorkersError, match="lonely: task 0 found no worker any more"):
            next(results)


def test_a_process_is_restarted_long_after_its_first_death(tmp_path: Path) -> None:
    hasty = dask.config.set({"distributed.deploy.lost-worker-timeout": "0.1 s"})
    with hasty, open_executor(DaskSettings(workers=1)) as executor:
        for death in range(2):
            payloads = [str(tmp_path / str(death))]
            assert list(executor.run(work.die_once, work.RECIPE, payloads, label="fit")) == [(0, "survived")]


def test_stopping_early_cancels_what_has_not_started(tmp_path: Path) -> None:
    with open_executor(DaskSettings(workers=1)) as executor:
        payloads = [(str(tmp_path / str(n)), 0.2) for n in range(20)]
        results = executor.run(work.mark_and_wait, work.RECIPE, payloads, label="slow")
        next(results)
        results.close()  # type: ignore[attr-defined]
        # The one process takes this up only after what the cancellation left of the work before.
        assert list(executor.run(work.combine, work.RECIPE, [2], label="next"))
        assert len(list(tmp_path.iterdir())) < len(payloads)


def test_a_lost_scheduler_ends_the_run() -> None:
    cluster = real_cluster(workers=1)
    address = cluster.__enter__()
    with open_executor(DaskSettings(address, wait_seconds=2)) as executor:
        results = executor.run(work.mark_and_wait, work.RECIPE, [(os.devnull, 0), (os.devnull, 60)], label="fit")
        next(results)
        cluster.__exit__(None, None, None)
        with pytest.raises(WorkersError, match=r"fit: lost the connection to tcp://.* with 1 tasks outstanding"):
            next(results)


def test_worker_processes_compute_with_one_thread() -> None:
    names = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"]
    with open_executor(DaskSettings(workers=1)) as executor:
        assert {value for _, value in executor.run(work.environment, work.RECIPE, names, label="env")} == {"1"}


def test_an_interrupt_does_not_reach_worker_processes() -> None:
    with open_executor(DaskSettings(workers=1)) as executor:
        [(_, before)] = executor.run(work.process_and_builds, work.RECIPE, [0], label="before")
        list(executor.run(work.interrupt_own_process, work.RECIPE, [None], label="interrupt"))
        [(_, after)] = executor.run(work.process_and_builds, work.RECIPE, [0], label="after")
    assert after == before


INTERRUPTED = """
from tests.workers import work
from workers import DaskSettings, open_executor
if __name__ == "__main__":
    try:
        with open_executor(DaskSettings(workers=2)) as executor:
            payloads = [("/dev/null", seconds) for seconds in (0, 60, 60)]
            results = executor.run(work.mark_and_wait, work.RECIPE, payloads, label="slow")
            next(results)
            print("running", flush=True)
            next(results)
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
    assert launcher.communicate(timeout=30)[0] == "stopped\n"
    assert launcher.returncode == 0


@pytest.mark.parametrize(
    ("label", "key"),
    [("fit island 2", "fit-island-2"), ("fit-island2", "fit-island2"), ("2nd", "task-2nd"), ("", "task-")],
)
def test_task_keys_begin_with_the_label(label: str, key: str) -> None:
    assert key_prefix(label) == key
