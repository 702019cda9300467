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
from pathlib import Path
from queue import Empty, SimpleQueue

from workers import Tls

ROOT = Path(__file__).parents[2]
PATIENCE_SECONDS = 60.0


@contextmanager
def real_cluster(workers: int = 2, python_path: Path | None = None, tls: Tls | None = None) -> Iterator[str]:
    """The address of a fresh scheduler on this machine that `workers` single-threaded processes have joined.

    `python_path` is a folder whose modules its processes find before all others. With `tls` they speak nothing
    else, all by the one certificate.
    """
    path = os.pathsep.join(str(folder) for folder in (python_path, ROOT) if folder)
    ports = ["--port", "0", "--dashboard-address", "127.0.0.1:0"]
    local = ["--no-dashboard", "--host", "127.0.0.1"]
    if tls:
        local += ["--protocol", "tls", "--tls-ca-file", str(tls.ca)]
        local += ["--tls-cert", str(tls.cert), "--tls-key", str(tls.key)]
    with ExitStack() as stack:
        scratch = stack.enter_context(tempfile.TemporaryDirectory())
        scheduler = stack.enter_context(_command("dask-scheduler", *ports, *local, path=path))
        address = _wait_for(scheduler, r"Scheduler at:\s+(\w+://\S+)")
        if workers:
            options = ["--nworkers", str(workers), "--local-directory", scratch, *local]
            nannies = stack.enter_context(_command("dask-worker", address, *options, path=path))
            for _ in range(workers):
                _wait_for(nannies, r"Registered to:\s+(\w+://\S+)")
        yield address


@contextmanager
def _command(name: str, *arguments: str, path: str) -> Iterator[SimpleQueue[str | None]]:
    """The lines that an installed command writes while it runs, None at their end."""
    process = subprocess.Popen(
        [Path(sys.executable).with_name(name), *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    lines: SimpleQueue[str | None] = SimpleQueue()
    reader = threading.Thread(target=_read, args=(process, lines), daemon=True)
    reader.start()
    try:
        yield lines
    finally:
        process.terminate()
        try:
            process.wait(3)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _read(process: subprocess.Popen[str], lines: SimpleQueue[str | None]) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        lines.put(line)
    lines.put(None)


def _wait_for(lines: SimpleQueue[str | None], pattern: str) -> str:
    seen = []
    while True:
        try:
            line = lines.get(timeout=PATIENCE_SECONDS)
        except Empty:
            line = None
        if line is None:
            raise AssertionError(f"no line matches {pattern!r} in:\n{''.join(seen)}")
        seen.append(line)
        if match := re.search(pattern, line):
            return match[1]
