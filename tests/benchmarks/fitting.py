"""Converged fits per second: this engine beside SciPy's Nelder-Mead over NumPy, on the same fits."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from fitters.fitting import Fit, FitSettings, Problem, fit_cells, refit_cells
from fitters.fitting.cells import Cells
from tests.benchmarks.candidates import Candidate, catalogue, random_candidates
from tests.benchmarks.plain import EVALUATIONS, PlainFit
from tests.benchmarks.problem import SEED
from tests.benchmarks.table import Cell, Table

RESTARTS = 4
"""Of SciPy per target."""

DESCENT = 8
"""Evaluations per searched parameter on all cells: from a fit on the fine sample it is a short way."""

Result = TypeVar("Result")


@dataclass(frozen=True)
class Extent:
    """What is fitted, and for how many of the targets SciPy does it too; its time is scaled to all of them.

    random:         candidates beside the catalogue's, on the sample
    sample_targets: of SciPy on the sample
    full:           formulas of the catalogue that are fitted on all cells
    full_targets:   of SciPy on all cells
    """

    random: int = 8
    sample_targets: int = 4
    full: tuple[str, ...] = ("phong", "cook-torrance", "ggx")
    full_targets: int = 1


def tables(problem: Problem, extent: Extent = Extent()) -> Iterator[Table]:
    """Fits on the sample, then on all cells."""
    candidates = (*catalogue(), *random_candidates(extent.random))
    yield _table(problem, problem.sample, candidates, _on_sample, extent.sample_targets)
    chosen = (candidate for candidate in catalogue() if candidate.name in extent.full)
    yield _table(problem, problem.full, chosen, _on_all, extent.full_targets)


def _table(
    problem: Problem,
    cells: Cells,
    candidates: Iterable[Candidate],
    engine: Callable[[Problem, Candidate], Fit],
    count: int,
) -> Table:
    every = len(problem.targets)
    targets = np.linspace(0, every - 1, count).astype(int)
    return Table(
        f"Converged fits, {len(cells):,} cells, {every} targets",
        (
            "formula",
            "parameters",
            "engine, ms",
            "fits per second",
            "SciPy, s",
            "ratio of times",
            "ratio of errors",
        ),
        tuple(_row(problem, cells, candidate, engine, targets) for candidate in candidates),
        (
            f"SciPy: Nelder-Mead over NumPy, {RESTARTS} restarts of {EVALUATIONS} evaluations per target, "
            f"measured for {count} of {every} targets and scaled to all.",
            "ratio of times: SciPy's to this engine's; of errors: this engine's to SciPy's, root mean squares "
            "over the targets that SciPy has fitted.",
        ),
    )


def _row(
    problem: Problem,
    cells: Cells,
    candidate: Candidate,
    engine: Callable[[Problem, Candidate], Fit],
    targets: np.ndarray,
) -> tuple[Cell, ...]:
    """Both in turns, the engine before and after every target of SciPy's."""
    seconds, found = _timed(lambda: engine(problem, candidate))
    own, others, errors = [seconds], [], []
    rng = np.random.default_rng(SEED)
    for target in targets:
        plain = PlainFit(candidate.expression, candidate.bounds, cells, int(target))
        starts = [plain.start(rng) for _ in range(RESTARTS)]
        seconds, ends = _timed(partial(plain.descents, starts))
        others.append(seconds)
        errors.append(min(plain.error(end) for end in ends))
        own.append(_timed(lambda: engine(problem, candidate))[0])
    mine, theirs = float(np.median(own)), float(np.mean(others)) * len(problem.targets)
    quality = float(np.linalg.norm(found.errors[targets]) / np.linalg.norm(errors))
    count = len(candidate.expression.parameters)
    return candidate.name, count, 1e3 * mine, 1 / mine, theirs, theirs / mine, quality


def _on_sample(problem: Problem, candidate: Candidate) -> Fit:
    return fit_cells(candidate.expression, problem.sample, problem.metric, candidate.bounds)


def _on_all(problem: Problem, candidate: Candidate) -> Fit:
    """On the fine sample, then by a short descent on all cells."""
    expression, metric, bounds = candidate.expression, problem.metric, candidate.bounds
    near = fit_cells(expression, problem.fine, metric, bounds)
    return refit_cells(expression, problem.full, metric, bounds, near.columns, FitSettings(), evaluations=DESCENT)


def _timed(work: Callable[[], Result]) -> tuple[float, Result]:
    started = time.perf_counter()
    result = work()
    return time.perf_counter() - started, result
