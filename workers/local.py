"""The executor that needs no cluster."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, ClassVar

from fitters.errors import FittersError
from workers.context import RAISES, Raised, attempt, context_of
from workers.errors import WorkersError, error_text, failure_text
from workers.jobs import Done, Failure, Incident, Job


@dataclass(frozen=True)
class LocalSettings:
    """Run in this process, one item after the other."""

    kind: ClassVar[str] = "local"

    def open(self, package: str | None) -> LocalExecutor:
        """See `ExecutorSettings.open`."""
        return LocalExecutor()


class LocalExecutor:
    """Runs items in this process when results are waited for, in order.

    What a function raises costs its item alone, as on a cluster; what crashes or hangs takes this process with it.
    """

    description = "this process"
    processes = 1

    def __init__(self) -> None:
        self._waiting: deque[tuple[Job, int]] = deque()

    @property
    def outstanding(self) -> int:
        return len(self._waiting)

    def submit(self, job: Job) -> None:
        """See `Executor.submit`."""
        self._waiting += ((job, index) for index in range(len(job.items)))

    def wait(self, seconds: float) -> list[Done]:
        """See `Executor.wait`: the next item, however long it takes."""
        if not self._waiting:
            return []
        job, index = self._waiting[0]
        result = self._result(job, index)
        self._waiting.popleft()
        return [Done(job, index, result)]

    def _result(self, job: Job, index: int) -> Any:
        for _ in range(RAISES):
            try:
                result = attempt(job.function, context_of(job.recipe), job.items[index])
            except Exception as error:
                bad_input, text = isinstance(error, FittersError), error_text(error)
                reason = failure_text(job.label, index, text, self.description, bad_input=bad_input)
                raise WorkersError(reason) from error
            if not isinstance(result, Raised):
                return result
        return Failure(f"raised {result.text}")

    def abandon(self) -> None:
        """See `Executor.abandon`."""
        self._waiting.clear()

    def incidents(self) -> list[Incident]:
        """Nothing happens here."""
        return []

    def close(self) -> None:
        """Nothing to close."""
