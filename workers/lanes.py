"""Several courses of work at once on one executor, each written as a generator of its jobs."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from contextlib import ExitStack, suppress
from typing import Any

from workers.executor import Executor
from workers.jobs import Done, Job

Lane = Generator[Job, list[Any], None]
"""Yields a job, is sent its results in the order of its items, goes on; no lane waits for the work of another."""

LOOK_SECONDS = 0.25
"""How long results are waited for before `stop` is asked again."""


class Stopped(Exception):
    """Thrown into lanes that are to end early. `results` holds, by index, what there is of the lane's own job."""

    def __init__(self, results: dict[int, Any]) -> None:
        super().__init__()
        self.results = results


def run_lanes(
    executor: Executor, lanes: Iterable[Lane], *, done: Callable[[Done], None], stop: Callable[[], bool]
) -> bool:
    """Runs lanes side by side to their ends; False where `stop` said to end early.

    `done` is called with every result. `Stopped` is thrown into every lane that has not ended when this function
    does, for whatever reason, so that it can save what it has.
    """
    running: dict[Job, tuple[Lane, dict[int, Any]]] = {}

    def resume(lane: Lane, results: list[Any] | None) -> None:
        with suppress(StopIteration):
            job = next(lane) if results is None else lane.send(results)
            while not job.items:
                job = lane.send([])
            running[job] = (lane, {})
            executor.submit(job)

    try:
        for lane in lanes:
            resume(lane, None)
        while running:
            if stop():
                return False
            news = executor.wait(LOOK_SECONDS)
            for one in news:
                running[one.job][1][one.index] = one.result
                done(one)
            for job in dict.fromkeys(one.job for one in news):
                lane, results = running[job]
                if len(results) == len(job.items):
                    del running[job]
                    resume(lane, [results[i] for i in range(len(results))])
        return True
    finally:
        with ExitStack() as stack:
            for lane, results in running.values():
                stack.callback(_end, lane, results)
            executor.abandon()


def _end(lane: Lane, results: dict[int, Any]) -> None:
    with suppress(Stopped, StopIteration):
        lane.throw(Stopped(results))
