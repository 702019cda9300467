"""A real Dask cluster for tests: the installed commands, in processes of their own."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, SimpleQueue

from workers import Tls

ROOT = Path(__file__).parents[2]
PATIENCE_SECONDS = 60.0
LOCAL = ["--no-dashboard", "--host", "127.0.0.1"]


@dataclass
class Command:
    """An installed command that runs; `log` holds the lines that it has written so far."""

    process: subprocess.Popen[str]
    log: list[str] = field(default_factory=list)
    _lines: SimpleQueue[str | None] = field(default_factory=SimpleQueue)

    def wait_for(self, pattern: str) -> str:
        """The first group of the next line that matches."""
        while True:
            try:
                line = self._lines.get(timeout=PATIENCE_SECONDS)
            except Empty:
                line = None
            if line is None:
                raise AssertionError(f"no line matches {pattern!r} in:\n{''.join(self.log)}")
            self.log.append(line)
            if match := re.search(pattern, line):
                return match[1]

    def kill(self) -> None:
        """SIGKILL for the command and all its processes, where it has not ended."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()

    def read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line)
        self._lines.put(None)


@dataclass
class Cluster:
    """A scheduler's address, and ways to change what is there. Its own options are those of every command."""

    stack: ExitStack
    scratch: str
    options: list[str]
    workers: list[Command] = field(default_factory=list)
    scheduler: Command = field(init=False)
    address: str = field(init=False)

    def start_scheduler(self, port: str = "0") -> None:
        options = ["--port", port, "--dashboard-address", "127.0.0.1:0", *LOCAL, *self.options]
        self.scheduler = self.command("dask-scheduler", *options)
        self.address = self.scheduler.wait_for(r"Scheduler at:\s+(\w+://\S+)")

    def restart_scheduler(self) -> None:
        """Kills the scheduler and starts another one on its port, as a supervisor would."""
        self.scheduler.kill()
        self.start_scheduler(port=self.address.rsplit(":", 1)[1])

    def start_workers(self, count: int = 1, *options: str, python_path: Path | None = None) -> Command:
        """Processes with a nanny each, which have joined."""
        arguments = ["--nworkers", str(count), "--local-directory", self.scratch, *LOCAL, *self.options, *options]
        nannies = self.command("dask-worker", self.address, *arguments, python_path=python_path)
        self.workers.append(nannies)
        for _ in range(count):
            nannies.wait_for(r"Registered to:\s+(\w+://\S+)")
        return nannies

    def repair(self, workers: int) -> None:
        """A scheduler is there, with that number of fresh workers."""
        for command in self.workers:
            command.kill()
        self.workers.clear()
        if self.scheduler.process.poll() is not None:
            self.start_scheduler(port=self.address.rsplit(":", 1)[1])
        self.start_workers(workers)

    def command(self, name: str, *arguments: str, python_path: Path | None = None) -> Command:
        path = os.pathsep.join(str(folder) for folder in (python_path, ROOT) if folder)
        return self.stack.enter_context(_command(name, *arguments, path=path))


@contextmanager
def real_cluster(workers: int = 2, python_path: Path | None = None, tls: Tls | None = None) -> Iterator[str]:
    """The address of a fresh scheduler on this machine that `workers` single-threaded processes have joined.

    `python_path` is a folder whose modules its workers find before all others. With `tls` they speak nothing
    else, all by the one certificate.
    """
    with changing_cluster(workers, python_path, tls) as cluster:
        yield cluster.address


@contextmanager
def changing_cluster(
    workers: int = 2, python_path: Path | None = None, tls: Tls | None = None
) -> Iterator[Cluster]:
    """A `real_cluster` to which things are done."""
    with ExitStack() as stack:
        scratch = stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True))
        cluster = Cluster(stack, scratch, _tls_options(tls))
        cluster.start_scheduler()
        if workers:
            cluster.start_workers(workers, python_path=python_path)
        yield cluster


def _tls_options(tls: Tls | None) -> list[str]:
    if tls is None:
        return []
    files = ["--tls-ca-file", str(tls.ca), "--tls-cert", str(tls.cert), "--tls-key", str(tls.key)]
    return ["--protocol", "tls", *files]


@contextmanager
def _command(name: str, *arguments: str, path: str) -> Iterator[Command]:
    process = subprocess.Popen(
        [Path(sys.executable).with_name(name), *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    command = Command(process)
    threading.Thread(target=command.read, daemon=True).start()
    try:
        yield command
    finally:
        command.kill()
