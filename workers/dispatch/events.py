"""Events, which tell the dispatcher what happened, and instructions, by which it answers.

Both are plain data: jobs, tasks and items have numbers, workers have addresses, and results stay outside. `now` is
the time of an event in seconds on a clock that never goes back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

# events


@dataclass(frozen=True, slots=True)
class Asked:
    """A job of `items` items was asked for, which take about `seconds` each; all of its `kind` cost the same."""

    now: float
    job: int
    label: str
    kind: str
    items: int
    seconds: float


@dataclass(frozen=True, slots=True)
class Abandoned:
    """Nothing that was asked for is needed any more."""

    now: float


@dataclass(frozen=True, slots=True)
class Tick:
    """Time has passed."""

    now: float


@dataclass(frozen=True, slots=True)
class Connected:
    """A scheduler was reached, and it has workers.

    threads:         of each worker, by address
    faults:          what is wrong with the package on workers that have another version of it, by address
    scheduler_fault: what is wrong with the scheduler's; empty where it is ours
    """

    now: float
    threads: Mapping[str, int]
    faults: Mapping[str, str]
    scheduler_fault: str = ""


@dataclass(frozen=True, slots=True)
class Unreachable:
    """An attempt to reach the scheduler again has failed."""

    now: float
    reason: str


@dataclass(frozen=True, slots=True)
class Disconnected:
    """The scheduler is gone, and every task with it."""

    now: float


@dataclass(frozen=True, slots=True)
class WorkersListed:
    """The workers that are there now: the threads of each, by address."""

    now: float
    threads: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class VersionsDiffer:
    """Workers that have another version of the package, and what is wrong, by address."""

    now: float
    faults: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class WorkerLeft:
    """A worker is gone; the cluster gives its tasks, the `keys`, to others. `died`: it left without notice."""

    now: float
    worker: str
    keys: Sequence[int]
    died: bool


@dataclass(frozen=True, slots=True)
class Began:
    """A task is running on a worker."""

    now: float
    key: int
    worker: str


@dataclass(frozen=True, slots=True)
class Finished:
    """A task came to its end after `seconds`. `raised`: position in the task and text of each exception."""

    now: float
    key: int
    seconds: float
    raised: Sequence[tuple[int, str]] = ()


@dataclass(frozen=True, slots=True)
class ResultLost:
    """A task came to its end, but its results were lost with its worker."""

    now: float
    key: int


@dataclass(frozen=True, slots=True)
class Dropped:
    """The cluster gave a task up after the deaths of workers, the last of them `worker`."""

    now: float
    key: int
    worker: str


@dataclass(frozen=True, slots=True)
class Erred:
    """A task failed as a whole, on the worker `where`.

    bad_input: the error says what is wrong with files or values that a user gave
    faults:    workers that have another version of the package, as far as known, by address
    """

    now: float
    key: int
    error: str
    where: str
    bad_input: bool = False
    faults: Mapping[str, str] | None = None


Event = (
    Asked
    | Abandoned
    | Tick
    | Connected
    | Unreachable
    | Disconnected
    | WorkersListed
    | VersionsDiffer
    | WorkerLeft
    | Began
    | Finished
    | ResultLost
    | Dropped
    | Erred
)

# instructions


@dataclass(frozen=True, slots=True)
class Submit:
    """Send out a task: the items at `indices` of a job.

    limit:   seconds after which the task counts as hanging
    suspect: processes were lost with these items before
    workers: that shall run it while one of them is there; None for any
    """

    key: int
    job: int
    indices: Sequence[int]
    limit: float
    suspect: bool
    workers: Sequence[str] | None


@dataclass(frozen=True, slots=True)
class Cancel:
    """The results of a task are not needed any more."""

    key: int


@dataclass(frozen=True, slots=True)
class Deliver:
    """The results at `positions` of the task that has just finished are those of the items at `indices`."""

    job: int
    indices: Sequence[int]
    positions: Sequence[int]


@dataclass(frozen=True, slots=True)
class GiveUp:
    """An item has no result, for a reason."""

    job: int
    index: int
    reason: str


@dataclass(frozen=True, slots=True)
class Record:
    """Something that a user should read later: see `workers.Incident`."""

    kind: str
    detail: str


@dataclass(frozen=True, slots=True)
class Disconnect:
    """Close the connection; try to reach the scheduler again."""


@dataclass(frozen=True, slots=True)
class Stop:
    """The work cannot go on, for a reason that a user can understand."""

    reason: str


Instruction = Submit | Cancel | Deliver | GiveUp | Record | Disconnect | Stop
