"""The transfer of a formula: its fit to materials that it was not searched on, kept on disk by content."""

from dataclasses import astuple
from pathlib import Path

import numpy as np

from fitters import cache, engine, expressions, materials, scenes
from fitters.fitting.fit import Fit
from fitters.fitting.problem import Problem
from fitters.fitting.stages import Description, FitJob, fit_formula
from fitters.judging.checks import Checks


def transfer(problem: Problem, job: FitJob) -> Description:
    """The formula of a job fitted to a problem's materials as thoroughly as what a search keeps, and described.

    Nothing of an earlier fit goes into it: the same formula, bounds, settings and problem give the same, and are
    fitted once on a machine. A formula that is not finite has infinite errors.
    """
    key = cache.digest(job.expressions, job.bounds, job.settings, problem.sha256, _code())
    return _read(cache.arrays("transfer", key, lambda: _arrays(fit_formula(problem, job)[0])))


def _arrays(description: Description) -> dict[str, np.ndarray]:
    found = description.fit
    return {
        "names": np.array(found.names, np.str_),
        "values": found.values,
        "errors": found.errors,
        "error": np.array(found.error),
        "evaluations": np.array(found.evaluations),
        "checks": np.array(astuple(description.checks)),
        "cost_ns": np.array(description.cost_ns),
        "warnings": np.array(description.warnings, np.str_),
        **{f"metric.{name}": np.array(value) for name, value in description.metrics.items()},
    }


def _read(stored: dict[str, np.ndarray]) -> Description:
    metrics = {name.removeprefix("metric."): float(v) for name, v in stored.items() if name.startswith("metric.")}
    found = Fit(
        names=tuple(map(str, stored["names"])),
        values=stored["values"],
        errors=stored["errors"],
        error=float(stored["error"]),
        evaluations=int(stored["evaluations"]),
    )
    checks = Checks(*map(float, stored["checks"]))
    return Description(found, metrics, checks, float(stored["cost_ns"]), tuple(map(str, stored["warnings"])))


def _code() -> str:
    """What reads and fits: a mended fit is not answered with what was found before."""
    packages = (engine, expressions, materials, scenes)
    return cache.of_code(Path(__file__).parent, *(Path(package.__path__[0]) for package in packages))
