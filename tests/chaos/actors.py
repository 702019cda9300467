"""Real processes on loopback that a test may kill: a scheduler, workers, a launcher."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import psutil

from gpsearch.run import Store

PATIENCE_SECONDS = 180.0
BIN = Path(sys.executable).parent


class Cluster:
    """A scheduler at one port for good, and groups of workers; both may be killed and started again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.scheduler: subprocess.Popen[bytes] | None = None
        self.groups: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> Cluster:
        self.start_scheduler()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill_workers()
        self.kill_scheduler()

    def start_scheduler(self) -> None:
        options = ["--host", "127.0.0.1", "--port", str(self.port), "--dashboard-address", "127.0.0.1:0"]
        self.scheduler = self._start("dask-scheduler", *options, "--no-dashboard")

    def start_workers(self, count: int) -> None:
        options = ["--nworkers", str(count), "--local-directory", str(self.folder / "scratch"), "--no-dashboard"]
        self.groups.append(self._start("dask-worker", self.address, *options, "--host", "127.0.0.1"))

    def _start(self, name: str, *arguments: str) -> subprocess.Popen[bytes]:
        log = (self.folder / f"{name}.log").open("ab")
        return subprocess.Popen(
            [BIN / name, *arguments], stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )

    def workers(self) -> list[psutil.Process]:
        """The processes that compute: what the nannies have started, and the scheduler knows.

        A nanny does not restart a worker that dies before it has reached the scheduler: it ends.
        """
        members = []
        for group in self.groups:
            try:
                children = psutil.Process(group.pid).children(recursive=True)
                members += [child for child in children if self._is_known(child)]
            except psutil.Error:
                continue
        return members

    def _is_known(self, process: psutil.Process) -> bool:
        connections = process.net_connections("tcp")
        reached = any(one.raddr and one.raddr.port == self.port for one in connections)
        return reached and "spawn_main" in " ".join(process.cmdline())

    def kill_scheduler(self) -> None:
        if self.scheduler is not None:
            _kill_group(self.scheduler)

    def kill_workers(self) -> None:
        """Workers and nannies, so that none is restarted."""
        for group in self.groups:
            _kill_group(group)
        self.groups.clear()


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    members = [process.pid]
    with suppress(psutil.Error):
        members += [child.pid for child in psutil.Process(process.pid).children(recursive=True)]
    for pid in members:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    process.wait()


class Launcher:
    """`gpsearch launch CONFIG --run RUN` in a folder, as often as it takes."""

    def __init__(self, folder: Path, config: str, run: str, cache: Path | None = None) -> None:
        self.folder, self.command = folder, [BIN / "gpsearch", "launch", config, "--run", run]
        self.run = folder / run
        self.dispatch = folder / "dispatch"
        self.dispatch.mkdir(exist_ok=True)
        self.environment = os.environ | {"WORKERS_LOG": str(self.dispatch)}
        if cache:
            self.environment["GPSEARCH_CACHE"] = str(cache)
        self.process: subprocess.Popen[bytes] | None = None
        self.log = folder / f"{run}.log"

    def start(self) -> None:
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                self.command,
                cwd=self.folder,
                env=self.environment,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def kill(self) -> None:
        assert self.process is not None
        _kill_group(self.process)

    def stop(self) -> int:
        """What a cluster does when a job's time is up; the exit status."""
        assert self.process is not None
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(PATIENCE_SECONDS)

    @property
    def ended(self) -> bool:
        return self.process is not None and self.process.poll() is not None

    def end(self) -> int:
        """Its exit status, once it has come to its end."""
        assert self.process is not None
        return self.process.wait(PATIENCE_SECONDS)

    def wait_until_stored(self, generations: int) -> bool:
        """Waits until islands have stored so many generations, added up; False where it ended before."""
        return self._wait(lambda: len(self.stored()) >= generations)

    def _wait(self, happened: Callable[[], bool]) -> bool:
        deadline = time.monotonic() + PATIENCE_SECONDS
        while not happened():
            if self.ended:
                return False
            assert time.monotonic() < deadline, self.log.read_text()
            time.sleep(0.02)
        return True

    def stored(self) -> set[tuple[int, int]]:
        """(island, generation) of what is safe."""
        if not (self.run / "run.sqlite").exists():
            return set()
        store = Store.open(self.run)
        try:
            return {(row.island, row.generation) for row in store.generations()}
        finally:
            store.close()
