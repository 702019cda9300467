"""What is asked of an executor, and what comes back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from workers.context import Recipe


@dataclass(frozen=True, eq=False)
class Job:
    """A pure function to run over items: `function(context, item)` in any process, `context` being the recipe's.

    label:   names the work in messages and on the dashboard: "screen island 2 generation 7"
    seconds: about how long an item takes; used until the first ones were measured
    """

    function: Callable[[Any, Any], Any]
    recipe: Recipe
    items: Sequence[Any]
    label: str
    seconds: float = 1.0

    @property
    def kind(self) -> str:
        """What has a cost of its own: the first word of the label."""
        return self.label.partition(" ")[0]


@dataclass(frozen=True)
class Failure:
    """In place of the result of an item that could not be computed: it raised, crashed or hung each time."""

    reason: str


@dataclass(frozen=True, eq=False)
class Done:
    """One item of a job, and its result or `Failure`."""

    job: Job
    index: int
    result: Any


class Incident(NamedTuple):
    """Something that a run's log should hold: "workers", "retry", "scheduler", ..., and a sentence."""

    kind: str
    detail: str
