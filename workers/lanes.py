"""Several courses of work at once on one executor, each written down from its first job to its last."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from contextlib import ExitStack, suppress
from typing import Any

from workers.executor import Executor
from workers.jobs import Done, Job

Lane = Generator[Job, list[Any], None]
"""Yields a job, is sent its results in the order of its items, goes on; no lane waits for another's work."""

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

    `done` hears of every result. Whatever ends it, every lane that is not at its end is thrown `Stopped`, and may
    save what it has.
    """
    under_way: dict[Job, tuple[Lane, dict[int, Any]]] = {}

    def resume(lane: Lane, results: list[Any] | None) -> None:
        with suppress(StopIteration):
            job = next(lane) if results is None else lane.send(results)
            while not job.items:
                job = lane.send([])
            under_way[job] = (lane, {})
            executor.submit(job)

    try:
        for lane in lanes:
            resume(lane, None)
        while under_way:
            if stop():
                return False
            results = executor.wait(LOOK_SECONDS)
            for result in results:
                under_way[result.job][1][result.index] = result.result
                done(result)
            for job in dict.fromkeys(result.job for result in results):
                lane, found = under_way[job]
                if len(found) == len(job.items):
                    del under_way[job]
                    resume(lane, [found[i] for i in range(len(found))])
        return True
    finally:
        with ExitStack() as stack:
            for lane, found in under_way.values():
                stack.callback(_end, lane, found)
            executor.abandon()


def _end(lane: Lane, found: dict[int, Any]) -> None:
    with suppress(Stopped, StopIteration):
        lane.throw(Stopped(found))
