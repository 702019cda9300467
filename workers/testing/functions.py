"""Functions over items for tests, which processes import from here, and the way to run one job."""

from __future__ import annotations

import ctypes
import os
import time
from typing import Any

from fitters.errors import FittersError
from workers.context import Recipe
from workers.executor import Executor
from workers.jobs import Job

builds = 0


def build(argument: str) -> str:
    global builds
    builds += 1
    return f"context of {argument}"


RECIPE = Recipe(build, "tests")


def results_of(executor: Executor, job: Job, wait: float = 5.0) -> dict[int, Any]:
    """Submits a job, alone, and waits for all its results; by index."""
    executor.submit(job)
    results: dict[int, Any] = {}
    while executor.outstanding:
        for done in executor.wait(wait):
            assert done.job is job
            assert done.index not in results
            results[done.index] = done.result
    return results


def square(_context: str, number: int) -> int:
    return number**2


def combine(context: str, number: int) -> tuple[str, int]:
    return context, number**2


def process_and_builds(_context: str, _item: Any) -> tuple[int, int]:
    """This process, and how many contexts it has built; takes a fiftieth of a second."""
    time.sleep(0.02)
    return os.getpid(), builds


def fail_at_three(_context: str, number: int) -> int:
    if number == 3:
        raise KeyError("no such thing")
    return number


def build_badly(argument: str) -> None:
    raise MemoryError(f"no room for {argument}")


def reject(_context: str, path: str) -> None:
    raise FittersError(f"{path} cannot be read: mount it there")


def crash(_context: str, number: int | None) -> int:
    """Ends the process by a bad pointer where the item is None."""
    if number is None:
        ctypes.string_at(0)
    assert number is not None
    return number


def hang(_context: str, number: int | None) -> int:
    """Never ends where the item is None."""
    while number is None:
        pass
    return number
