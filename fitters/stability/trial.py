"""One method on one case: numbers only, so that outcomes travel, and verdicts are made of them elsewhere."""

import math
import re
import time
from collections.abc import Callable, Mapping
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
"""In place of a hazard: the base as it is."""
EXACT = 0.01
"""An error that counts as none where others are compared with it."""
JUDGED = ("light", "compressive")
"""The metrics of which an error counts: one follows the bright parts, the other does not."""


@dataclass(frozen=True)
class Trial:
    """What to run. `level` is a place among the hazard's levels."""

    method: str
    hazard: str
    level: int
    seed: int


@dataclass(frozen=True)
class Outcome:
    """What came of a trial.

    errors:     by metric, of the fit against the truth in every lit cell, the root mean square over channels;
                infinite where there is no fit or it is not finite
    raised:     what the method raised, or nothing
    crashed:    whether that was no `FittersError`: a defect
    spread:     how far apart its restarts ended, relative, the largest of all channels
    shown:      likewise against the measurement, where it was measured: what a user is told
    parameters: largest relative error of a known parameter
    condition:  the largest condition number of its channels; flat: its flat directions, in relative changes
    warnings:   what it said of itself
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

    Whatever a method raises is an outcome; a case that cannot be made raises `FittersError`.
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
    """What comes of running a method on a case."""
    began = time.perf_counter()
    infinite = dict.fromkeys(JUDGED, math.inf)
    try:
        found = run(case, trial.seed)
        seconds = time.perf_counter() - began
        errors = errors_against(case.truth, case, found)
        shown = errors_against(case.measured, case, found)
    except FittersError as error:
        return Outcome(trial, infinite, time.perf_counter() - began, raised=str(error))
    except Exception as error:
        # To find these is what a trial is for.
        said = f"{type(error).__name__}: {error}"
        return Outcome(trial, infinite, time.perf_counter() - began, raised=said, crashed=True)
    finite = [one.condition for one in found.conditioning]
    return Outcome(
        trial,
        errors,
        seconds,
        shown,
        spread=spread(found.ends),
        parameters=parameter_error(case, found),
        condition=max(finite) if finite else None,
        flat=tuple({tuple(sorted(flat)): flat for one in found.conditioning for flat in one.flat}.values()),
        warnings=found.warnings,
    )


def failed(trial: Trial, reason: str) -> Outcome:
    """Of a trial that took its process with it, or never ended."""
    return Outcome(trial, dict.fromkeys(JUDGED, math.inf), 0.0, raised=reason, crashed=True)


def errors_against(material: Material, case: Case, found: Found) -> dict[str, float]:
    """The errors by metric against a material in every lit cell that is valid there."""
    with np.errstate(all="ignore"):
        by_metric = model_errors(Problem([material], case.light), 0, found.model)
    return {name: _finite(math.sqrt(float(np.mean(np.square(by_metric[name]))))) for name in JUDGED}


def _finite(value: float) -> float:
    return value if math.isfinite(value) else math.inf


def spread(ends: np.ndarray | None) -> float | None:
    """(worst - best) / best of final errors (restarts, channels), the largest of the channels.

    Where the best is below `EXACT`, relative to that. None without restarts.
    """
    if ends is None or len(ends) < 2:
        return None
    best, worst = np.min(ends, axis=0), np.max(ends, axis=0)
    apart = (worst - best) / np.maximum(best, EXACT)
    return float(np.max(np.nan_to_num(apart, nan=0.0, posinf=1e9)))


def parameter_error(case: Case, found: Found) -> float | None:
    """The largest relative error of a parameter that is known, over the channels; None where none is."""
    worst = [
        abs(value / truth - 1)
        for formula, parameters in case.known.items()
        for name, truth in parameters.items()
        for value in (found.parameters or {}).get(formula, {}).get(name, ())
    ]
    return max(worst, default=None)


def same_warning(sentence: str) -> str:
    """A warning without its numbers, channels and materials: what kind of warning it is."""
    words = re.sub(r"[\d.,%+e-]+", "#", sentence.split(": ", 1)[-1])
    return re.sub("|".join(CHANNELS), "", words)
