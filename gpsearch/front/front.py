"""The front: confirmed candidates that no other beats in error and size at once."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from fitters.fits import Fit
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


@dataclass(frozen=True)
class Front:
    """Members by rising size, their errors strictly falling."""

    members: tuple[Member, ...] = ()

    def updated(self, candidates: Iterable[Member]) -> "Front":
        """The front of the members and the candidates together; of equals in both the first by text stays."""
        pool = {member.expression: member for member in (*candidates, *self.members)}
        kept: list[Member] = []
        for member in sorted(pool.values(), key=lambda m: (m.nodes, m.error, m.expression)):
            if member.error < (kept[-1].error if kept else float("inf")):
                kept.append(member)
        return Front(tuple(kept))

    def bar(self, nodes: int) -> float:
        """What an expression of this size must stay below on the small sample to be worth a confirmation.

        The worse of the two errors of each member: a sample flatters some of them, and a flattered member must
        not shut the door.
        """
        return min((max(m.screened, m.error) for m in self.members if m.nodes <= nodes), default=float("inf"))

    def worth_confirming(self, screened: Mapping[str, tuple[int, float]]) -> list[str]:
        """Which of the candidates, (nodes, screened error) by expression, could enter the front."""
        chosen: list[str] = []
        best = float("inf")
        for text, (nodes, error) in sorted(screened.items(), key=lambda item: (*item[1], item[0])):
            if error < min(best, self.bar(nodes)):
                chosen.append(text)
                best = error
        return chosen
