"""Recipes and functions that the tests run in worker processes, which import them from here."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from distributed import get_worker

from fitters.errors import FittersError
from workers import Recipe

builds = 0


def build(argument: str) -> str:
    global builds
    builds += 1
    return f"context of {argument}"


RECIPE = Recipe(build, "tests")


def combine(context: str, payload: int) -> tuple[str, int]:
    return context, payload**2


def process_and_builds(_context: str, _payload: int) -> tuple[int, int]:
    time.sleep(0.02)
    return os.getpid(), builds


def fail_at_three(_context: str, payload: int) -> int:
    if payload == 3:
        raise KeyError("no such thing")
    return payload


def reject(_context: str, payload: str) -> None:
    raise FittersError(f"{payload} cannot be read: mount it there")


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


def die(_context: str, _payload: None) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def interrupt_own_process(_context: str, _payload: None) -> None:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.3)


def leave_for_good(_context: str, _payload: None) -> None:
    """Has its worker retired: it goes, and nothing restarts it."""
    worker = get_worker()
    worker.loop.add_callback(worker.close_gracefully, restart=False)
    time.sleep(60)


def environment(_context: str, payload: str) -> str | None:
    return os.environ.get(payload)
