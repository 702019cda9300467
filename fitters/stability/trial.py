"""Trials: which ones there are, and the outcome of one method on one case, as numbers that processes can send."""

import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from threadpoolctl import threadpool_limits

from fitters.errors import FittersError
from fitters.fitting import Problem, model_errors
from fitters.grid import CHANNELS
from fitters.materials import Material, load_material
from fitters.stability.case import Base, Case, metal, undisturbed
from fitters.stability.hazards import HAZARDS
from fitters.stability.methods import METHODS, Found

UNDISTURBED = "undisturbed"
"""The name of the base as it is, in place of a hazard."""
EXACT = 0.01
"""Smaller errors count as this one where others are divided by them."""
JUDGED = ("light", "compressive")
"""The metrics by which a fit is judged: the first depends mostly on the bright parts, the second does not."""


@dataclass(frozen=True)
class Trial:
    """A method, a hazard, an index of the hazard's levels, and a seed."""

    method: str
    hazard: str
    level: int
    seed: int


@dataclass(frozen=True)
class Outcome:
    """The outcome of a trial.

    errors:     by metric, of the fit against the truth in every lit cell, the root mean square over channels;
                infinite where there is no fit or it is not finite
    shown:      errors against the measurement, in the cells that were measured, as a user sees them
    raised:     the message of an exception, or empty
    crashed:    whether the exception was not a `FittersError`, which is a defect
    spread:     relative distance of the ends of its restarts, the largest of all channels
    parameters: the largest relative error of a known parameter
    condition:  the largest condition number of its channels
    flat:       its flat directions, in relative changes of the parameters
    warnings:   its warnings
    """

    trial: Trial
    errors: Mapping[str, float]
    seconds: float
    shown: Mapping[str, float] = field(default_factory=dict)
    raised: str = ""
    crashed: bool = False
    spread: float | None = None
    parameters: float | None = None
    condition: float | None = None
    flat: tuple[Mapping[str, float], ...] = ()
    warnings: tuple[str, ...] = ()


def run_trial(reference: str | None, trial: Trial) -> Outcome:
    """Runs a trial on the material of a reference, or on the built-in GGX metal.

    An exception of the method is an outcome. Raises `FittersError` where the case cannot be made.
    """
    case = case_of(reference, trial.hazard, trial.level, trial.seed)
    # With more threads BLAS adds up in another order, and outcomes differ in their last bits.
    with threadpool_limits(1, "blas"):
        return outcome_of(trial, case, METHODS[trial.method].run)


def base_of(reference: str | None) -> Base:
    """The undisturbed material."""
    return metal() if reference is None else Base(_loaded(reference))


@lru_cache(maxsize=1)
def _loaded(reference: str) -> Material:
    return load_material(reference)


@lru_cache(maxsize=2)
def case_of(reference: str | None, hazard: str, level: int, seed: int) -> Case:
    """The case of a hazard; equal arguments give equal cases anywhere."""
    base = base_of(reference)
    return undisturbed(base) if hazard == UNDISTURBED else HAZARDS[hazard].make(base, level, seed)


def outcome_of(trial: Trial, case: Case, run: Callable[[Case, int], Found]) -> Outcome:
    """The outcome of a method on a case."""
    began = time.perf_counter()
    infinite = dict.fromkeys(JUDGED, math.inf)
    try:
        fitted = run(case, trial.seed)
        seconds = time.perf_counter() - began
        errors = errors_against(case.truth, case, fitted)
        shown = errors_against(case.measured, case, fitted)
    except FittersError as error:
        return Outcome(trial, infinite, time.perf_counter() - began, raised=str(error))
    except Exception as error:
        # A trial is there to find these.
        said = f"{type(error).__name__}: {error}"
        return Outcome(trial, infinite, time.perf_counter() - began, raised=said, crashed=True)
    finite = [one.condition for one in fitted.conditioning]
    return Outcome(
        trial,
        errors,
        seconds,
        shown,
        spread=spread(fitted.ends),
        parameters=parameter_error(case, fitted),
        condition=max(finite) if finite else None,
        flat=tuple({tuple(sorted(flat)): flat for one in fitted.conditioning for flat in one.flat}.values()),
        warnings=fitted.warnings,
    )


def failed(trial: Trial, reason: str) -> Outcome:
    """The outcome of a trial whose process ended, or which did not end in time."""
    return Outcome(trial, dict.fromkeys(JUDGED, math.inf), 0.0, raised=reason, crashed=True)


def errors_against(material: Material, case: Case, fitted: Found) -> dict[str, float]:
    """The errors by metric against a material in every lit cell that is valid there."""
    with np.errstate(all="ignore"):
        by_metric = model_errors(Problem([material], case.light), 0, fitted.model)
    return {name: _finite(math.sqrt(float(np.mean(np.square(by_metric[name]))))) for name in JUDGED}


def _finite(value: float) -> float:
    return value if math.isfinite(value) else math.inf


def spread(ends: np.ndarray | None) -> float | None:
    """(worst - best) / best of final errors (restarts, channels), the largest of the channels.

    Best errors below `EXACT` count as `EXACT`. None without restarts.
    """
    if ends is None or len(ends) < 2:
        return None
    best, worst = np.min(ends, axis=0), np.max(ends, axis=0)
    apart = (worst - best) / np.maximum(best, EXACT)
    return float(np.max(np.nan_to_num(apart, nan=0.0, posinf=1e9)))


def parameter_error(case: Case, fitted: Found) -> float | None:
    """The largest relative error of a known parameter over the channels; None where no parameter is known."""
    worst = [
        abs(value / truth - 1)
        for formula, parameters in case.known.items()
        for name, truth in parameters.items()
        for value in (fitted.parameters or {}).get(formula, {}).get(name, ())
    ]
    return max(worst, default=None)


def same_warning(sentence: str) -> str:
    """A warning without its numbers, channels and materials, to compare kinds of warnings."""
    words = re.sub(r"[\d.,%+e-]+", "#", sentence.split(": ", 1)[-1])
    return re.sub("|".join(CHANNELS), "", words)


def trials_of(methods: Sequence[str], hazards: Sequence[str], seeds: int, any_material: bool) -> list[Trial]:
    """All trials, case by case, so that a case is made once; the undisturbed material first.

    Seeds that change neither the case nor the method's result are left out. With `any_material`, hazards that need
    a formula of their own are left out.
    """
    cases = [(UNDISTURBED, 0, False)]
    for name in hazards:
        hazard = HAZARDS[name]
        if hazard.any_base or not any_material:
            cases += [(name, level, hazard.random) for level in range(len(hazard.levels))]
    return [
        Trial(method, name, level, seed)
        for name, level, random in cases
        for seed in range(seeds)
        for method in methods
        if seed == 0 or random or METHODS[method].seeded
    ]


def skipped(methods: Sequence[str], hazards: Sequence[str], seeds: int, any_material: bool) -> list[str]:
    """The trials that `trials_of` leaves out, in sentences."""
    sentences = []
    if missing := [name for name in METHODS if name not in methods]:
        sentences.append(f"methods not asked for: {', '.join(missing)}")
    if missing := [name for name in HAZARDS if name not in hazards]:
        sentences.append(f"hazards not asked for: {', '.join(missing)}")
    if any_material and (own := [name for name in hazards if not HAZARDS[name].any_base]):
        sentences.append(f"hazards that are formulas of their own, of which a material has none: {', '.join(own)}")
    fixed = [name for name in methods if not METHODS[name].seeded]
    if seeds > 1 and fixed:
        sentences.append(f"further seeds of {', '.join(fixed)} where the hazard does not depend on the seed")
    return sentences


def level_names() -> dict[tuple[str, int], str]:
    """The name of every level of every hazard."""
    return {(hazard.name, i): level for hazard in HAZARDS.values() for i, level in enumerate(hazard.levels)}
