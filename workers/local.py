"""The executor that needs no cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from workers.context import Recipe, context_of
from workers.errors import task_failed

P = TypeVar("P")
R = TypeVar("R")


class LocalExecutor:
    """Runs each task in this process when its result is asked for, in order."""

    description = "this process"
    processes = 1

    def run(
        self, function: Callable[[Any, P], R], recipe: Recipe, payloads: Iterable[P], *, label: str
    ) -> Iterator[tuple[int, R]]:
        """See `Executor.run`; the indices come in order."""
        for index, payload in enumerate(payloads):
            try:
                result = function(context_of(recipe), payload)
            except Exception as error:
                raise task_failed(label, index, error, self.description) from error
            yield index, result

    def close(self) -> None:
        """Nothing to let go of."""
