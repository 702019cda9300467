"""Functions that the tests run in worker processes, which import them from here."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from pathlib import Path

from distributed import get_worker

from workers.testing.functions import (
    RECIPE,
    combine,
    crash,
    hang,
    process_and_builds,
    results_of,
    square,
)

__all__ = ["RECIPE", "combine", "crash", "hang", "process_and_builds", "results_of", "square"]


def square_slowly(_context: str, payload: tuple[int, float]) -> int:
    number, seconds = payload
    time.sleep(seconds)
    return number**2


def square_and_process(context: str, payload: tuple[int, float]) -> tuple[int, int]:
    return square_slowly(context, payload), os.getpid()


def slow_at_first(_context: str, payload: tuple[str, int]) -> int:
    """A number's square; takes a minute for number 3 where no file is at the path yet, which it leaves."""
    path, number = payload
    if number == 3 and not Path(path).exists():
        Path(path).touch()
        time.sleep(60)
    return number**2


def mark_and_wait(_context: str, payload: tuple[str, float]) -> None:
    """Leaves a file at the path when it starts, then takes the seconds."""
    path, seconds = payload
    Path(path).touch()
    time.sleep(seconds)


def die_once(_context: str, payload: str) -> str:
    """Kills its own process unless the file is there already, which it leaves."""
    marker = Path(payload)
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "survived"


def interrupt_own_process(_context: str, _payload: None) -> None:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.3)


def hang_with_the_lock(_context: str, payload: int | None) -> int:
    """Where the payload is None: compiled code that neither ends nor gives the interpreter lock away."""
    if payload is None:
        ctypes.PyDLL(None).sleep(3600)
    assert payload is not None
    return payload


def eat_memory(_context: str, payload: int | None) -> int:
    """Takes all the memory there is, a megabyte at a time, where the payload is None."""
    eaten = []
    while payload is None:
        eaten.append(b"x" * 2**20)
        time.sleep(0.001)
    return payload


def process_after(_context: str, seconds: float) -> tuple[int, str]:
    """The worker's process and its address, after some seconds."""
    time.sleep(seconds)
    return os.getpid(), get_worker().address


def chatter(_context: str, _payload: int | None) -> None:
    print("out")
    print("err", file=sys.stderr)
    os.write(2, b"compiled code")


def leave_for_good(_context: str, _payload: None) -> None:
    """Has its worker retired: it goes, and nothing restarts it."""
    worker = get_worker()
    worker.loop.add_callback(worker.close_gracefully, restart=False)
    time.sleep(60)


def environment(_context: str, payload: str) -> str | None:
    return os.environ.get(payload)


def fake_version(folder: Path, version: str) -> None:
    """Has processes that find modules in the folder first believe that they have this version of our package."""
    metadata = folder / f"gpsearch-{version}.dist-info" / "METADATA"
    metadata.parent.mkdir()
    metadata.write_text(f"Metadata-Version: 2.1\nName: gpsearch\nVersion: {version}\n")
