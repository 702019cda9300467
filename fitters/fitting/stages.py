"""What a worker does with candidates: pure functions of a fit problem and a small payload.

A search screens thousands of candidates on a small sample of cells, confirms on all cells those that could enter
the front, and at last describes the members of the front in full.
"""

import math
import time
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import numpy as np

from fitters import backends, cache, engine, expressions, judging, materials, scenes
from fitters.engine.cost import cost_ns
from fitters.expressions import parse
from fitters.fitting.cell_fit import Columns, Fit, fit_cells, refit_cells
from fitters.fitting.exact import exact_errors
from fitters.fitting.polish import polish
from fitters.fitting.problem import Problem
from fitters.fitting.settings import Bounds, FitSettings
from fitters.fitting.warnings import warnings_of
from fitters.judging import metrics
from fitters.judging.checks import Checks, check
from fitters.judging.metrics import RESIDUALS

PROBE_EVALUATIONS = 10
"""Per searched parameter, of the descent that decides whether a candidate is fitted thoroughly."""


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


@dataclass(frozen=True, eq=False)
class ConfirmJob:
    """A job of one expression to fit on all cells, its parameters if it was screened, and what it must beat.

    What clearly does not reach `bar`, an error on all cells, is not fitted thoroughly.
    """

    job: FitJob
    near: Columns | None = None
    bar: float = math.inf


@dataclass(frozen=True)
class DescriptionJob:
    """A confirmed fit to describe, and the job, of this one expression, that found it."""

    job: FitJob
    fit: Fit


@dataclass(frozen=True)
class Confirmed:
    """A fit on all cells, or on the fine sample where that has shown that it does not reach its bar."""

    fit: Fit
    seconds: float


@dataclass(frozen=True)
class Description:
    """All that is reported of a front member or baseline. `metrics` holds its error by every metric.

    `warnings` are sentences that say where the fit is not to be relied on, see `fitters.fitting.warnings`.
    """

    fit: Fit
    metrics: dict[str, float]
    checks: Checks
    cost_ns: float
    warnings: tuple[str, ...] = ()


def screen(
    problem: Problem,
    candidate: Candidate,
    *,
    bounds: tuple[tuple[str, float, float], ...],
    settings: FitSettings,
) -> Fit:
    """The fit of a candidate on the small sample, its parameters within bounds (name, low, high)."""
    return fit_cells(
        parse(candidate.expression),
        problem.sample,
        problem.metric,
        {name: (low, high) for name, low, high in bounds},
        settings,
        near=candidate.near,
        bar=candidate.bar,
    )


def confirm(problem: Problem, task: ConfirmJob) -> Confirmed:
    """The fit of an expression that may be kept: thoroughly on the fine sample, judged on all cells.

    First a short descent on the fine sample tells whether that is worth the work.
    """
    started = time.perf_counter()
    bounds, settings, metric = task.job.intervals, task.job.settings, problem.metric
    expression = parse(task.job.expressions[0])
    near = task.near or fit_cells(expression, problem.sample, metric, bounds, settings).columns
    fit = refit_cells(expression, problem.fine, metric, bounds, near, settings, evaluations=PROBE_EVALUATIONS)
    if fit.error - fit.standard_error <= task.bar:
        fit = fit_cells(expression, problem.fine, metric, bounds, settings.thorough(), near=fit.columns)
        fit = refit_cells(expression, problem.full, metric, bounds, fit.columns, settings, evaluations=0)
    return Confirmed(fit, time.perf_counter() - started)


def describe(problem: Problem, task: DescriptionJob) -> Description:
    """A confirmed fit polished on all cells, its exact errors by every metric, its checks and its cost."""
    job = task.job
    expression = parse(job.expressions[0])
    fit = polish(expression, problem.full, problem.metric, job.intervals, task.fit)
    exact = exact_errors(expression, problem, fit)
    errors = exact.by_metric[problem.metric.name]
    fit = replace(fit, errors=errors, error=problem.metric.combine(errors))
    return Description(
        fit=fit,
        metrics={name: RESIDUALS[name].combine(values) for name, values in exact.by_metric.items()},
        checks=check(expression, fit, exact.minimum),
        cost_ns=cost_ns(expression),
        warnings=warnings_of(expression, problem, job.intervals, job.settings, fit),
    )


def fit_formula(problem: Problem, job: FitJob) -> tuple[Description, float]:
    """The fit of one expression as thoroughly as it goes, described, and how many seconds it took without that.

    The errors of a formula that is not finite on every lit cell are infinite.
    """
    confirmed = confirm(problem, ConfirmJob(job))
    return describe(problem, DescriptionJob(job, confirmed.fit)), confirmed.seconds


def transfer(problem: Problem, job: FitJob) -> Description:
    """The formula of a job fitted to a problem's materials as thoroughly as what a search keeps, and described.

    Nothing of an earlier fit goes into it: the same formula, bounds, settings and problem give the same, and are
    fitted once on a machine. A formula that is not finite has infinite errors.
    """
    key = cache.digest(job.expressions, job.bounds, job.settings, problem.sha256, _code())
    return _read(cache.arrays("transfer", key, lambda: _arrays(fit_formula(problem, job)[0])))


def _arrays(description: Description) -> dict[str, np.ndarray]:
    fit = description.fit
    return {
        "names": np.array(fit.names, np.str_),
        "values": fit.values,
        "errors": fit.errors,
        "error": np.array(fit.error),
        "evaluations": np.array(fit.evaluations),
        "checks": np.array(astuple(description.checks)),
        "cost_ns": np.array(description.cost_ns),
        "warnings": np.array(description.warnings, np.str_),
        **{f"metric.{name}": np.array(value) for name, value in description.metrics.items()},
    }


def _read(stored: dict[str, np.ndarray]) -> Description:
    metrics = {name.removeprefix("metric."): float(v) for name, v in stored.items() if name.startswith("metric.")}
    fit = Fit(
        names=tuple(map(str, stored["names"])),
        values=stored["values"],
        errors=stored["errors"],
        error=float(stored["error"]),
        evaluations=int(stored["evaluations"]),
    )
    checks = Checks(*map(float, stored["checks"]))
    return Description(fit, metrics, checks, float(stored["cost_ns"]), tuple(map(str, stored["warnings"])))


def _code() -> str:
    """What reads and fits: a corrected fit is not answered with what was kept before."""
    packages = (backends, engine, expressions, judging, metrics, materials, scenes)
    return cache.of_code(Path(__file__).parent, *(Path(package.__path__[0]) for package in packages))
