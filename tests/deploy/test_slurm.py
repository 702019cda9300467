"""The SLURM recipe: its scripts run as they are, with commands that stand in for SLURM's."""

import importlib.util
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from tests.deploy.paths import DEPLOY, documents, installed
from tests.gpsearch.small import PATIENCE_SECONDS, small_text

FOLDER = DEPLOY / "slurm"

SBATCH = """
# As sbatch does, keeps the script, whose file its writer deletes.
setsid bash -c "$(cat "$1")" >>workers.log 2>&1 </dev/null &
echo $! >>submitted
echo "Submitted batch job $!"
"""
SCANCEL = """
echo "$1" >>cancelled
kill -TERM -- "-$1"
"""
SCONTROL = """
echo "$@" >>requeued
"""
ENDLESS_SEARCH = """
trap 'exit 143' TERM
echo "$@" >arguments
echo running
while true; do sleep 0.1; done
"""
SEARCH_UNTIL_THREE_JOBS = """
until [ "$(cat submitted 2>/dev/null | wc -l)" -ge 3 ]; do sleep 0.1; done
"""


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Path]:
    """A folder with the recipe, sized for a test, and with the commands of a site that is this machine."""
    resize(FOLDER / "launch.py", tmp_path, PORT=free_port(), PROCESSES=2, MAXIMUM_JOBS=1, INTERVAL=1)
    for name, text in {"sbatch": SBATCH, "scancel": SCANCEL, "scontrol": SCONTROL}.items():
        command(tmp_path, name, text)
    yield tmp_path
    for job in [*lines(tmp_path / "submitted"), *lines(tmp_path / "launched")]:
        subprocess.run(["kill", "-KILL", "--", f"-{job}"], capture_output=True, check=False)


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("", 0))
        return int(listener.getsockname()[1])


def resize(source: Path, folder: Path, **constants: float) -> None:
    """A copy of `source` in `folder` with other constants."""
    text = source.read_text()
    for name, value in constants.items():
        text, count = re.subn(rf"^{name} = \d+", f"{name} = {value}", text, flags=re.MULTILINE)
        assert count == 1, name
    (folder / source.name).write_text(text)


def command(folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(f"#!/usr/bin/env bash{text}")
    (folder / name).chmod(0o755)


def lines(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []


def launcher(site: Path, *arguments: str) -> subprocess.Popen[str]:
    """The launcher's job, as SLURM would start it in `site`."""
    environment = os.environ | {
        "PATH": os.pathsep.join([str(site), str(Path(sys.executable).parent), os.environ["PATH"]]),
        "PYTHONPATH": str(DEPLOY.parent),
        "SLURM_JOB_ID": "4711",
    }
    job = subprocess.Popen(
        ["bash", FOLDER / "launcher.sbatch", *arguments],
        cwd=site,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    (site / "launched").write_text(f"{job.pid}\n")
    return job


def start_endless_search(site: Path, *arguments: str) -> subprocess.Popen[str]:
    command(site, "gpsearch", ENDLESS_SEARCH)
    job = launcher(site, *arguments)
    assert job.stdout is not None
    assert job.stdout.readline() == "running\n"
    return job


def test_a_search_whose_time_is_up_is_stopped_and_queued_again(site: Path) -> None:
    job = start_endless_search(site, "search.yaml", "--run", "a folder")
    job.send_signal(signal.SIGUSR1)
    assert job.wait(PATIENCE_SECONDS) == 143
    assert lines(site / "requeued") == ["requeue 4711"]
    assert lines(site / "arguments") == ["launch search.yaml --run a folder"]


def test_a_cancelled_search_is_stopped_and_not_queued_again(site: Path) -> None:
    job = start_endless_search(site)
    job.send_signal(signal.SIGTERM)
    assert job.wait(PATIENCE_SECONDS) == 143
    assert lines(site / "requeued") == []


@pytest.mark.parametrize("status", [0, 1, 2])
def test_a_search_that_ends_by_itself_gives_the_job_its_status(site: Path, status: int) -> None:
    command(site, "gpsearch", f"\nexit {status}\n")
    assert launcher(site).wait(PATIENCE_SECONDS) == status
    assert lines(site / "requeued") == []


def test_jobs_whose_workers_left_are_replaced_and_the_last_is_cancelled(site: Path) -> None:
    # Workers that live for three seconds.
    resize(site / "launch.py", site, WALLTIME=0.05, STAGGER=0, CLOSING=0)
    command(site, "gpsearch", SEARCH_UNTIL_THREE_JOBS)
    assert launcher(site).wait(PATIENCE_SECONDS) == 0
    assert set(lines(site / "cancelled")) >= set(lines(site / "submitted")[2:])


@pytest.mark.long
def test_a_real_search_finds_its_front_on_workers_that_are_jobs(site: Path) -> None:
    port = re.findall(r"^PORT = (\d+)", (site / "launch.py").read_text(), re.MULTILINE)[0]
    executor = {"kind": "dask", "scheduler": f"tcp://127.0.0.1:{port}"}
    (site / "small.yaml").write_text(small_text(executor=executor))
    assert launcher(site, "small.yaml", "--run", "run").wait(PATIENCE_SECONDS) == 0
    assert (site / "run/front.json").exists()
    assert len(lines(site / "submitted")) == 1


@pytest.fixture(scope="module")
def launch() -> ModuleType:
    specification = importlib.util.spec_from_file_location("launch", FOLDER / "launch.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_the_job_script_of_a_worker(launch: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(launch, "PORT", free_port())
    with launch.slurm_cluster() as cluster:
        script = cluster.job_script()
    assert subprocess.run(["bash", "-n"], input=script, text=True, check=False).returncode == 0
    done = subprocess.run(
        [installed("shellcheck"), "-"], input=script, text=True, capture_output=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "")
    assert f"#SBATCH --cpus-per-task={launch.PROCESSES}" in script
    assert "--nthreads 1 " in script
    assert "#SBATCH --signal=B:TERM@" in script
    # The shell that gets the signal has become the worker.
    assert script.splitlines()[-1].startswith(f"exec {sys.executable} ")


def test_a_worker_leaves_before_its_job_is_ended(launch: ModuleType) -> None:
    lifetime = launch.WALLTIME - launch.STAGGER - launch.CLOSING
    assert 0 < lifetime + launch.STAGGER < launch.WALLTIME


def test_the_launcher_is_sound_shell() -> None:
    done = subprocess.run(
        [installed("shellcheck"), FOLDER / "launcher.sbatch"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "")


def test_the_configuration_names_the_port_of_the_scheduler(launch: ModuleType) -> None:
    executor = documents(FOLDER / "search.yaml")[0]["executor"]
    assert executor["scheduler"] == f"tcp://127.0.0.1:{launch.PORT}"
