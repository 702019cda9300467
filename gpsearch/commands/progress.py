"""Progress at the terminal: a live line with rich, plain lines where the output is no terminal."""

import time
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from gpsearch.search.plan import Budget
from gpsearch.search.search import SearchStatus
from workers import Incident

T = TypeVar("T")

PLAIN_SECONDS = 10.0
"""Without a terminal a line is written at most so often; the last generation always has one."""


class ProgressWatcher:
    """Shows how a search goes on; a context manager. A `Watcher` of `gpsearch.search.search`."""

    def __init__(self, console: Console, budget: Budget) -> None:
        self.console, self.budget = console, budget
        self.live = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self.task = self.live.add_task("starting", total=None)
        self.began = time.monotonic()
        self.printed = -PLAIN_SECONDS

    def __enter__(self) -> "ProgressWatcher":
        self.live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.live.stop()

    def stage(self, name: str, total: int | None) -> None:
        self.live.reset(self.task, description=name, total=total)

    def step(self, count: int) -> None:
        self.live.advance(self.task, count)

    def generation(self, status: SearchStatus) -> None:
        now = time.monotonic() - self.began
        last = status.generation == self.budget.generations
        if self.console.is_terminal or last or now - self.printed >= PLAIN_SECONDS:
            self.printed = now
            self.console.print(self._line(status))

    def incident(self, incident: Incident) -> None:
        """What a person should know while it happens; all of it is in the event log."""
        if incident.kind in ("workers", "scheduler", "refused"):
            self.console.print(f"{incident.kind}: {incident.detail}")

    def _line(self, status: SearchStatus) -> str:
        members = status.front.members
        total = f"/{self.budget.generations}" if self.budget.generations is not None else ""
        rate = status.candidates / max(status.seconds, 1e-9)
        best = f"{members[-1].error:.4f} at {members[-1].nodes} nodes" if members else "none yet"
        left = seconds_left(self.budget, status.generation, status.candidates, status.seconds)
        return (
            f"generation {status.generation}{total}  {rate:.0f} candidates/s  best {best}"
            f"  front {len(members)}" + (f"  {duration(left)} left" if left is not None else "")
        )


def counted(items: Iterable[T], total: int, what: str) -> Iterator[T]:
    """The items, while a bar at the terminal counts them."""
    with Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
        disable=not Console(stderr=True).is_terminal,
    ) as live:
        yield from live.track(items, total=total, description=what)


def seconds_left(budget: Budget, generation: int, candidates: int, seconds: float) -> float | None:
    """By the budget that runs out first at the pace so far; None where nothing can be told yet."""
    left = []
    if budget.generations is not None and generation:
        left.append(seconds / generation * (budget.generations - generation))
    if budget.candidates is not None and candidates:
        left.append(seconds * (budget.candidates / candidates - 1))
    if budget.seconds is not None:
        left.append(budget.seconds - seconds)
    return max(min(left), 0.0) if left else None


def duration(seconds: float) -> str:
    """`45 s`, `12 min`, `3.5 h`."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def work(candidates: int, fitted: int, given_up: int) -> str:
    """`98 % fitted, 2 % known from before, 31 % given up early`, in shares of the candidates."""
    shares = (fitted, candidates - fitted, given_up)
    whole, known, stopped = (f"{100 * share / max(candidates, 1):.0f} %" for share in shares)
    return f"{whole} fitted, {known} known from before, {stopped} given up early"
