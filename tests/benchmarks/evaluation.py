"""What one evaluation of the objective costs: this engine beside NumPy, numexpr and Operon."""

import importlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fitters.engine.multistart import Descent
from fitters.engine.prepared import Prepared
from fitters.expressions import Expression
from fitters.expressions.evaluation import evaluate_features
from fitters.fitting import Problem, fit_cells
from fitters.fitting.cells import Cells
from tests.benchmarks.candidates import Candidate, catalogue
from tests.benchmarks.problem import draw
from tests.benchmarks.table import Cell, Table
from tests.benchmarks.timing import medians

EVALUATIONS = 64
"""Of the engine in one call."""

RIVALS = ("numexpr", "pyoperon")
AGREEMENT = 0.01
"""Relative difference from NumPy's sum of squares up to which a rival has evaluated the same formula."""

Objective = Callable[[], float]


@dataclass(frozen=True)
class Extent:
    """cells: of each table; rounds: of which the median is taken."""

    cells: tuple[int, ...] = (2048, 65536)
    rounds: int = 9


def tables(problem: Problem, extent: Extent = Extent()) -> Iterator[Table]:
    """One table per number of cells: ns per cell and evaluation, and how many times as long the others take."""
    for count in extent.cells:
        yield _table(problem, draw(problem.full, count), extent.rounds)


def _table(problem: Problem, cells: Cells, rounds: int) -> Table:
    notes = {
        "ratio: of the other's time to this engine's. All have one thread, and float32 but for NumPy.",
        "The engine's time holds the closed-form solution of what is linear; the others evaluate at its result.",
    }
    rows: list[tuple[Cell, ...]] = []
    for candidate in catalogue():
        parameters = fit_cells(candidate.expression, problem.sample, problem.metric, candidate.bounds).parameters(
            0
        )
        rivals = {"NumPy": numpy_objective(candidate.expression, parameters, cells)}
        for name in RIVALS:
            found = _rival(name, candidate, parameters, cells, rivals["NumPy"]())
            if isinstance(found, str):
                notes.add(found)
            else:
                rivals[name] = found
        seconds = medians({"engine": _engine(candidate, parameters, cells), **rivals}, rounds)
        engine = seconds["engine"] / EVALUATIONS
        ratios = [seconds[name] / engine if name in seconds else None for name in ("NumPy", *RIVALS)]
        rows.append((candidate.name, candidate.expression.nodes, 1e9 * engine / len(cells), *ratios))
    rows.append(("geometric mean", None, *(_geometric_mean([row[i] for row in rows]) for i in range(2, 6))))
    return Table(
        f"Evaluation of the objective, {len(cells):,} cells, one target",
        ("formula", "nodes", "engine, ns per cell", "NumPy, ratio", "numexpr, ratio", "Operon, ratio"),
        tuple(rows),
        tuple(sorted(notes)),
    )


def numpy_objective(expression: Expression, parameters: Mapping[str, float], cells: Cells) -> Objective:
    """The first target's sum of squares in float64, from the tree."""
    weights, targets = (array[0].astype(np.float64) for array in (cells.weights, cells.targets))

    def evaluate() -> float:
        residuals = weights * evaluate_features(expression, parameters, cells.features) - targets
        return float(np.einsum("i,i", residuals, residuals))

    return evaluate


def _engine(candidate: Candidate, parameters: Mapping[str, float], cells: Cells) -> Callable[[], object]:
    """`EVALUATIONS` evaluations of the first target, as a table of starts that no descent follows."""
    prepared = Prepared(
        candidate.expression, cells.features, cells.weights[:1], cells.targets[:1], candidate.bounds
    )
    at = prepared.coordinates({name: np.array([value]) for name, value in parameters.items()})
    starts, near = np.repeat(at, EVALUATIONS, axis=0), np.empty((0, at.shape[1]))
    descent = Descent(restarts=0, rounds=0, step=0.5, limit=0, tolerance=0.0, hopeless=np.inf, poor=np.inf)
    return lambda: prepared.fit(starts, near, descent)


def _rival(
    package: str, candidate: Candidate, parameters: Mapping[str, float], cells: Cells, expected: float
) -> Objective | str:
    """The objective by another package; where there is none, a note why."""
    try:
        importlib.import_module(package)
    except ImportError:
        return f"{package} is not installed: pip install .[benchmark]"
    form = importlib.import_module(f"tests.benchmarks.{package.removeprefix('py')}_form")
    found: Objective = form.objective(candidate.expression, parameters, cells)
    if not abs(found() - expected) <= AGREEMENT * expected:
        return f"{candidate.name} by {package}: {found():.4g} where NumPy has {expected:.4g}"
    return found


def _geometric_mean(values: list[Cell]) -> float | None:
    numbers = [value for value in values if isinstance(value, float)]
    return float(np.exp(np.mean(np.log(numbers)))) if numbers else None
