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

    def worth_confirming(self, screened: Mapping[str, tuple[int, float]]) -> list[str]:
        """Which of the candidates, (nodes, screened error) by expression, could enter the front.

        A candidate is compared with members of its size or less by the worse of their two errors: a sample
        flatters some of them, and a flattered member must not shut the door.
        """
        chosen: list[str] = []
        best = float("inf")
        bars = [(m.nodes, max(m.screened, m.error)) for m in self.members]
        for text, (nodes, error) in sorted(screened.items(), key=lambda item: (*item[1], item[0])):
            bar = min([best, *(bar for size, bar in bars if size <= nodes)])
            if error < bar:
                chosen.append(text)
                best = error
        return chosen
