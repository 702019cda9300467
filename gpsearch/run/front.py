"""The front: confirmed candidates that no other beats in error and size at once."""

import math
import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

from fitters.fitting import Fit
from gpsearch.genomes import Genome


@dataclass(frozen=True, eq=False)
class Member:
    """A confirmed candidate. `screened` is its error on the small sample, with which new ones are compared."""

    expression: str
    nodes: int
    genome: Genome
    island: int
    generation: int
    fit: Fit
    screened: float

    @property
    def error(self) -> float:
        return self.fit.error


@dataclass(frozen=True, slots=True)
class Screened:
    """What is known of a candidate before it is confirmed: its error on the small sample."""

    expression: str
    nodes: int
    error: float
    standard_error: float = 0.0


@dataclass(frozen=True, slots=True)
class Known:
    """What is remembered of a candidate's fit on the small sample.

    error:      infinite where nothing finite was found; of a fit that was given up, what it had reached
    bar:        what the fit failed; infinite where it was completed
    island:     that had it fitted
    generation: in which that was
    """

    error: float
    standard_error: float = 0.0
    bar: float = math.inf
    island: int = 0
    generation: int = 0

    @property
    def precedence(self) -> tuple[float, int, int]:
        """Of several fits of a form the one that sorts first counts: nearest to its end, then oldest."""
        return (-self.bar, self.generation, self.island)


T = TypeVar("T")


def non_dominated(
    items: Iterable[T],
    costs: Callable[[T], tuple[float, ...]],
    ties: Callable[[T], Any] = lambda item: (),
    *,
    keep_equals: bool = False,
) -> list[T]:
    """The items that no other beats, sorted by their costs: none is at most as high in all costs and lower in one.

    Of items with equal costs the first by `ties` stays, or all of them. An item with a cost that is not finite
    does not compete.
    """
    kept: list[tuple[tuple[float, ...], T]] = []
    finite = [(cost, item) for item in items if all(map(math.isfinite, cost := costs(item)))]
    # Whatever beats an item is sorted before it.
    for cost, item in sorted(finite, key=lambda pair: (pair[0], ties(pair[1]))):
        better = (other for other, _ in kept if all(map(operator.le, other, cost)))
        if all(keep_equals and other == cost for other in better):
            kept.append((cost, item))
    return [item for _, item in kept]


SAME = 1e-4
"""Relative difference up to which two errors on one sample count as one."""


@dataclass(frozen=True)
class Front:
    """Members by rising size, their errors strictly falling."""

    members: tuple[Member, ...] = ()

    def updated(self, candidates: Iterable[Member]) -> "Front":
        """The front of the members and the candidates together, the same in whatever order they come.

        Of equals in both the first by text stays, and of the same expression the oldest.
        """
        members = non_dominated(
            (*self.members, *candidates),
            costs=lambda member: (member.nodes, member.error),
            ties=lambda member: (member.expression, member.generation, member.island),
        )
        return Front(tuple(members))

    def error(self, nodes: int) -> float:
        """What an expression of this size must stay below to enter."""
        return min((m.error for m in self.members if m.nodes <= nodes), default=float("inf"))

    def bar(self, nodes: int) -> float:
        """What an expression of this size must stay below on the small sample to be worth a confirmation.

        The larger of the two errors of each member: on the small sample some have a smaller error than on all
        cells, and would exclude candidates that are better.
        """
        return min((max(m.screened, m.error) for m in self.members if m.nodes <= nodes), default=float("inf"))

    def worth_confirming(self, screened: Iterable[Screened]) -> list[str]:
        """The expressions that could enter the front: those within a standard error of doing so.

        What has the error of something smaller to some digits, on the same sample, is the same function written
        at greater length, and is passed over.
        """
        chosen: list[str] = []
        best = float("inf")
        known = [(member.nodes, member.screened) for member in self.members]
        for one in sorted(screened, key=lambda s: (s.nodes, s.error, s.expression)):
            smaller = [error for nodes, error in known if nodes <= one.nodes]
            repeats = any(abs(error - one.error) <= SAME * one.error for error in smaller)
            bar = min(self.bar(one.nodes), best)
            if one.error - one.standard_error < bar and not repeats:
                chosen.append(one.expression)
                known.append((one.nodes, one.error))
                best = min(best, one.error)
        return chosen
