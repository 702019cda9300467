"""The formulas that a run lists: what its front is once every member is described and culled."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from fitters import expressions
from fitters.fitting import Description
from fitters.fitting.culling import Step
from gpsearch.run.front import Member
from gpsearch.run.store import Store


@dataclass(frozen=True)
class ListedFormula:
    """A front member, or what culling has left of it: then `before` and `steps` say of what, and how."""

    member: Member
    expression: str
    nodes: int
    description: Description
    before: Description | None = None
    steps: tuple[Step, ...] = ()


def listed_formulas(store: Store) -> list[ListedFormula]:
    """The front by size, the error on all cells strictly falling. What is not described yet is not there."""
    return _non_dominated(_described(store))


def _described(store: Store) -> list[ListedFormula]:
    """The members that are described; of those that were culled, what is left."""
    described, culled = store.descriptions(), store.culled()
    found = []
    for member in store.front().members:
        if (before := described.get(member.expression)) is None:
            continue
        left = culled.get(member.expression)
        if left is None or left.description is None:
            found.append(ListedFormula(member, member.expression, member.nodes, before))
        else:
            nodes = expressions.parse(left.expression).nodes
            found.append(ListedFormula(member, left.expression, nodes, left.description, before, left.steps))
    return found


def _non_dominated(formulas: Iterable[ListedFormula]) -> list[ListedFormula]:
    """Polish and culling may have changed who beats whom."""
    kept: list[ListedFormula] = []
    for formula in sorted(formulas, key=lambda f: (f.nodes, f.description.fit.error, f.expression)):
        if formula.description.fit.error < (kept[-1].description.fit.error if kept else math.inf):
            kept.append(formula)
    return kept
