"""The culling of one fitted formula: a pure function of formula, fit problem, bounds, settings and tolerance.

The genBRDF paper ends a search by "culling unimportant sub-expressions" (section 1) by hand. Here every single
reduction is tried, the cheapest is taken, and so on, on the two samples of the fit problem; then all cells have
the last word.
"""

from dataclasses import dataclass, replace

import numpy as np

from fitters.expressions import Expression, parse, to_text
from fitters.fitting import ConfirmJob, Description, DescriptionJob, FitJob, Problem, confirm, describe
from fitters.fitting.cell_fit import Fit, refit_cells
from fitters.fitting.cells import Cells
from fitters.fitting.culling.greedy import FREE, RECIPROCAL, Demands, Greedy, Stage, Step, contiguous
from fitters.fitting.culling.reductions import substituted
from fitters.judging.checks import Checks
from fitters.judging.metrics import length

EXACT = 1e-5
"""An error of so small a share of what there is to explain is none: the engine reckons in 24 bits."""


@dataclass(frozen=True)
class CullJob:
    """A described formula to cull, and the job, of this one expression, that found it.

    tolerance: largest relative growth of the error on all cells
    """

    job: FitJob
    description: Description
    tolerance: float


@dataclass(frozen=True)
class Culled:
    """What is left of a formula, its parameters named p0, p1, .. without gaps, and the steps that led there.

    description: of what is left; None where nothing could go
    """

    expression: str
    steps: tuple[Step, ...] = ()
    description: Description | None = None


def cull(problem: Problem, task: CullJob) -> Culled:
    """The smallest formula that one reduction after another leads to within the tolerance on all cells.

    Nodes are what the tolerance buys; parameters and digits of constants go where that costs nothing. What is left
    is finite on all lit cells, and neither reciprocity nor the lack of negative values is lost. Where the error
    on all cells has grown too much, steps are undone from the last.
    """
    text, before = task.job.expressions[0], task.description
    if not np.isfinite(before.fit.error):
        return Culled(text)
    start = _start(problem, task)
    limit = _limit(problem, problem.full, before.fit.error, task.tolerance)
    trail = Greedy(problem, task.job.intervals, task.job.settings, _demands(problem, task, start)).trail(start)
    for last in range(len(trail) - 1, 0, -1):
        expression, description = _described(problem, task, trail[last], limit)
        if description is not None and _keeps(description, before.checks, limit):
            steps = tuple(stage.step for stage in trail[1 : last + 1] if stage.step is not None)
            return Culled(expression, steps, description)
    return Culled(text)


def _start(problem: Problem, task: CullJob) -> Stage:
    """The formula as it is, at its best on either sample, so that only what is taken away makes a difference."""
    expression = parse(task.job.expressions[0])
    sample, fine = (_refit(problem, cells, task, expression) for cells in (problem.sample, problem.fine))
    return Stage(expression, sample, fine)


def _refit(problem: Problem, cells: Cells, task: CullJob, expression: Expression) -> Fit:
    job, near = task.job, task.description.fit.columns
    return refit_cells(
        expression, cells, problem.metric, job.intervals, near, job.settings, evaluations=job.settings.evaluations
    )


def _demands(problem: Problem, task: CullJob, start: Stage) -> Demands:
    checks = task.description.checks
    return Demands(
        sample=_limit(problem, problem.sample, start.sample.error, task.tolerance),
        fine=_limit(problem, problem.fine, start.fine.error, task.tolerance),
        nothing=_nothing(problem, problem.sample),
        reciprocal=checks.reciprocity <= RECIPROCAL,
        nonnegative=checks.minimum >= 0.0,
    )


def _limit(problem: Problem, cells: Cells, error: float, tolerance: float) -> float:
    """What the error on some cells may grow to."""
    return max((1.0 + tolerance) * error, _nothing(problem, cells))


def _nothing(problem: Problem, cells: Cells) -> float:
    """An error on some cells that is none."""
    return EXACT * problem.metric.combine(np.array([length(row) for row in cells.targets]))


def _described(problem: Problem, task: CullJob, stage: Stage, limit: float) -> tuple[str, Description | None]:
    """A stage under new names, fitted on all cells and described; None where its error is beyond the limit."""
    names = contiguous(stage.expression)
    text = to_text(substituted(stage.expression, {old: Expression(new) for old, new in names.items()}))
    bounds = tuple((names[name], low, high) for name, low, high in task.job.bounds if name in names)
    job = replace(task.job, expressions=(text,), bounds=bounds)
    near = {names[name]: values for name, values in stage.fine.columns.items()}
    confirmed = confirm(problem, ConfirmJob(job, near))
    # The last polish may lower it a little.
    if not confirmed.fit.error <= (1.0 + FREE) * limit:
        return text, None
    return text, describe(problem, DescriptionJob(job, confirmed.fit))


def _keeps(description: Description, before: Checks, limit: float) -> bool:
    """Whether a culled formula is within the limit, and as good a reflectance as the one before it."""
    checks = description.checks
    reciprocal = checks.reciprocity <= RECIPROCAL or before.reciprocity > RECIPROCAL
    nonnegative = checks.minimum >= 0.0 or before.minimum < 0.0
    return description.fit.error <= limit and reciprocal and nonnegative
