"""What a worker does with candidates: pure functions of a fit problem and a small payload.

A search screens thousands of candidates on a small sample of cells, confirms on all cells those that could enter
the front, and at last describes the members of the front in full.
"""

import math
import time
from dataclasses import dataclass, replace

from fitters.engine.cost import cost_ns
from fitters.expressions import parse
from fitters.fits.checks import Checks, check
from fitters.fits.exact import exact_errors
from fitters.fits.fit import Bounds, Columns, Fit, FitSettings, fit, refit
from fitters.fits.metrics import METRICS
from fitters.fits.polish import polish
from fitters.fits.problem import FitProblem


@dataclass(frozen=True)
class FitJob:
    """Expressions to fit, in text form, all with the same bounds (name, low, high) and settings."""

    expressions: tuple[str, ...]
    bounds: tuple[tuple[str, float, float], ...]
    settings: FitSettings

    @property
    def intervals(self) -> Bounds:
        return {name: (low, high) for name, low, high in self.bounds}


@dataclass(frozen=True, eq=False)
class Candidate:
    """An expression to screen: a fit that will not come near `bar` is given up; `near` is a warm start."""

    expression: str
    bar: float = math.inf
    near: Columns | None = None


@dataclass(frozen=True)
class ScreenJob:
    """Candidates to fit, all with the same bounds (name, low, high) and settings."""

    candidates: tuple[Candidate, ...]
    bounds: tuple[tuple[str, float, float], ...]
    settings: FitSettings


@dataclass(frozen=True)
class DescriptionJob:
    """A confirmed fit to describe, and the job, of this one expression, that found it."""

    job: FitJob
    fit: Fit


@dataclass(frozen=True)
class Confirmed:
    """A fit on all cells, beside the error of the same expression on the small sample."""

    fit: Fit
    screened: float
    seconds: float


@dataclass(frozen=True)
class Description:
    """All that is reported of a front member or baseline. `metrics` holds its error by every metric."""

    fit: Fit
    metrics: dict[str, float]
    checks: Checks
    cost_ns: float


def screen(problem: FitProblem, job: ScreenJob) -> list[Fit]:
    """The fits of a job's candidates on the small sample."""
    bounds = {name: (low, high) for name, low, high in job.bounds}
    return [
        fit(
            parse(candidate.expression),
            problem.sample,
            problem.metric,
            bounds,
            job.settings,
            near=candidate.near,
            bar=candidate.bar,
        )
        for candidate in job.candidates
    ]


def confirm(problem: FitProblem, job: FitJob) -> list[Confirmed]:
    """The fits of a job's expressions: screened, fitted thoroughly on the fine sample, judged on all cells."""
    return [_confirm(problem, text, job) for text in job.expressions]


def _confirm(problem: FitProblem, text: str, job: FitJob) -> Confirmed:
    started = time.perf_counter()
    expression, metric, bounds, settings = parse(text), problem.metric, job.intervals, job.settings.thorough()
    screened = fit(expression, problem.sample, metric, bounds, job.settings)
    found = fit(expression, problem.fine, metric, bounds, settings, near=screened.columns)
    found = refit(expression, problem.full, metric, bounds, found.columns, settings, evaluations=0)
    return Confirmed(found, screened.error, time.perf_counter() - started)


def describe(problem: FitProblem, task: DescriptionJob) -> Description:
    """A confirmed fit polished on all cells, its exact errors by every metric, its checks and its cost."""
    job = task.job
    expression = parse(job.expressions[0])
    found = polish(expression, problem.full, problem.metric, job.intervals, task.fit)
    exact = exact_errors(expression, problem, found)
    errors = exact.by_metric[problem.metric.name]
    found = replace(found, errors=errors, error=problem.metric.combine(errors))
    return Description(
        fit=found,
        metrics={name: METRICS[name].combine(values) for name, values in exact.by_metric.items()},
        checks=check(expression, found, exact.minimum),
        cost_ns=cost_ns(expression),
    )
