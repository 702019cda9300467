"""Genomes, the expressions that they stand for, and crossover."""

import hashlib
from dataclasses import asdict, dataclass
from typing import Any

from fitters.expressions import Expression
from gpsearch.genomes.edits import Delete, Draft, Edit, Insert, Replace, Swap, parsed

_NAMES: dict[str, type[Edit]] = {"swap": Swap, "insert": Insert, "replace": Replace, "delete": Delete}


@dataclass(frozen=True, slots=True)
class Genome:
    """A starting expression in text form and the edits that are applied to it, in order.

    All genomes of a generation have the same number of edits.
    """

    start: str
    edits: tuple[Edit, ...] = ()

    def with_edit(self, edit: Edit) -> "Genome":
        return Genome(self.start, (*self.edits, edit))

    def to_json(self) -> list[dict[str, Any]]:
        """The edits as plain objects, `{"edit": "swap", ...}`, with nodes by label."""
        return list(map(edit_json, self.edits))

    @classmethod
    def from_json(cls, start: str, edits: list[dict[str, Any]]) -> "Genome":
        return cls(start, tuple(_NAMES[e["edit"]](**{k: v for k, v in e.items() if k != "edit"}) for e in edits))


def edit_json(edit: Edit) -> dict[str, Any]:
    return {"edit": type(edit).__name__.lower(), **asdict(edit)}


def draft(genome: Genome) -> Draft:
    """The genome's expression as a draft, with all edits applied."""
    label = hashlib.sha256(genome.start.encode()).hexdigest()[:8]
    result = Draft.of(parsed(genome.start), label)
    for edit in genome.edits:
        result.apply(edit)
    return result


def reify(genome: Genome) -> Expression:
    """The expression that a genome stands for."""
    return draft(genome).expression()


def crossover(first: Genome, second: Genome, cut: int) -> tuple[Genome, Genome]:
    """One-point crossover (Holland 1992): the two genomes exchange the edits after the first `cut`.

    Both are cut at the same position, so that an edit keeps its position, which is the generation that it is from,
    and no genome has an edit twice.
    """
    return (
        Genome(first.start, first.edits[:cut] + second.edits[cut:]),
        Genome(second.start, second.edits[:cut] + first.edits[cut:]),
    )
