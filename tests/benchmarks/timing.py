"""Times to be compared, taken in turns so that what else the machine does touches all of them alike."""

import time
from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

import numpy as np

Name = TypeVar("Name", bound=Hashable)

LEAST_SECONDS = 2e-3
"""What is shorter is called several times in a row and the mean taken."""


def medians(works: Mapping[Name, Callable[[], object]], rounds: int) -> dict[Name, float]:
    """Median seconds of a call of each work. Every round goes through all works: A B A B."""
    repeats = {name: max(1, round(LEAST_SECONDS / _seconds(work, 1))) for name, work in works.items()}
    seconds: dict[Name, list[float]] = {name: [] for name in works}
    for _ in range(rounds):
        for name, work in works.items():
            seconds[name].append(_seconds(work, repeats[name]))
    return {name: float(np.median(times)) for name, times in seconds.items()}


def _seconds(work: Callable[[], object], repeats: int) -> float:
    started = time.perf_counter()
    for _ in range(repeats):
        work()
    return (time.perf_counter() - started) / repeats
