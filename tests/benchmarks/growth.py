"""How the time of one fit grows with cells, searched parameters, targets and nodes."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from fitters.expressions import Expression, parse
from fitters.expressions.catalogue import formula
from fitters.fitting import Fit, Problem, fit_cells
from fitters.fitting.cells import Cells, Coarse, sample
from tests.benchmarks.problem import SEED, draw
from tests.benchmarks.table import Table
from tests.benchmarks.timing import medians

FORMULA = "ggx"
"""What is fitted where the formula does not grow: two parameters searched, two linear."""

TERMS = (
    "pow(dot(wo, wh), p0 * {i})",
    "exp(-pow(acos(wh.z) / p0, 2) * {i})",
    "p0 * p0 / (pi * pow(wh.z * wh.z * (p0 * p0 - 1) + {i}, 2))",
    "sqrt(p0 * p0 + {i} * wi.z * wo.z)",
)
"""Of which sums of any size are made; finite everywhere, and different for every whole number i from 1."""

Work = Callable[[], Fit]


@dataclass(frozen=True)
class Extent:
    """What is varied, one at a time, and the rounds of which the median is taken."""

    cells: tuple[int, ...] = (512, 2048, 8192, 32768, 131072, 524288, 1_400_000)
    searched: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 8)
    targets: tuple[int, ...] = (3, 6, 12, 24, 60)
    terms: tuple[int, ...] = (1, 2, 4, 8, 16)
    rounds: int = 3


def tables(problem: Problem, extent: Extent = Extent()) -> Iterator[Table]:
    """One table for each of what a fit grows with; everything else as in a search's screening."""
    published = formula(FORMULA)

    def of(cells: Cells) -> Work:
        return lambda: fit_cells(published.expression, cells, problem.metric, published.bounds)

    def at(expression: Expression) -> Work:
        bounds = dict.fromkeys(expression.parameters, (0.01, 10.0))
        return lambda: fit_cells(expression, problem.sample, problem.metric, bounds)

    sampled = (_with_cells(problem.full, count) for count in extent.cells)
    yield _table("cells", "1,000 cells", {len(cells): of(cells) for cells in sampled}, extent.rounds)
    repeated = {count: of(_with_targets(problem.sample, count)) for count in extent.targets}
    yield _table("targets", "target", repeated, extent.rounds)
    searched = {count: at(_with_searched(count)) for count in extent.searched}
    yield _table("searched parameters", "parameter", searched, extent.rounds)
    sums = (_with_terms(count) for count in extent.terms)
    yield _table("nodes", "node", {expression.nodes: at(expression) for expression in sums}, extent.rounds)


def _table(what: str, unit: str, works: Mapping[int, Work], rounds: int) -> Table:
    """The times of fits by how many of `what` they have, and per unit of it."""
    size = 1000 if unit.startswith("1,000") else 1
    evaluations = {count: work().evaluations for count, work in works.items()}
    seconds = medians(works, rounds)
    rows = tuple(
        (
            f"{count:,}",
            evaluations[count],
            1e3 * seconds[count],
            1e3 * seconds[count] * size / count,
            1e6 * seconds[count] / evaluations[count],
        )
        for count in works
    )
    columns = (what, "evaluations", "ms", f"ms per {unit}", "us per evaluation")
    return Table(f"The time of one fit by its {what}", columns, rows)


def _with_cells(cells: Cells, count: int) -> Cells:
    """A sample as a search's, of fewer cells than `count` since some are drawn twice; else cells repeated."""
    return sample(cells, count, SEED) if count < len(cells) else draw(cells, count)


def _with_targets(cells: Cells, count: int) -> Cells:
    """Cells with `count` targets, the same ones again and again."""

    def rows(array: np.ndarray) -> np.ndarray:
        return np.resize(array, (count, array.shape[1]))

    coarse = cells.coarse and Coarse(rows(cells.coarse.weights), rows(cells.coarse.targets))
    return replace(cells, weights=rows(cells.weights), targets=rows(cells.targets), coarse=coarse)


def _with_searched(count: int) -> Expression:
    """A sum of Gaussian lobes about the normal, whose widths are all that is fitted."""
    return parse(" + ".join(f"exp(-pow(acos(wh.z) / p{i}, 2))" for i in range(count)))


def _with_terms(count: int) -> Expression:
    """A sum of so many different terms in one searched and one linear parameter."""
    return parse(" + ".join(["p1", *(TERMS[i % len(TERMS)].format(i=i + 1) for i in range(count))]))
