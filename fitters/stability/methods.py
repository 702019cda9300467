"""The methods under test, by name: each takes a case and a seed and says what it made of it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from scipy.optimize import minimize

from fitters.errors import FittersError
from fitters.expressions import Expression
from fitters.expressions.catalogue import formula
from fitters.expressions.evaluation import evaluate_features
from fitters.fitting import FitSettings, Problem, fit_formula
from fitters.fitting.conditioning import Conditioning, conditioning
from fitters.fitting.warnings import restart_errors
from fitters.grid import CHANNELS, Array
from fitters.models import FormulaModel, Model, material_fitter
from fitters.models.factors import solving
from fitters.models.factors.channel import Channel
from fitters.models.factors.fitting import FactorFit, fit_from_starts, fit_independent_g, fit_naive
from fitters.models.factors.samples import Samples
from fitters.models.factors.solving import Solved
from fitters.models.factors.starts import slices, starts
from fitters.models.factors.tables import MicrofacetFactors, SmithFactors
from fitters.models.formula import formula_models, published
from fitters.stability.case import Case

THIN, THIN_ROUNDS = 15, 20
"""AWLS runs on every 15th azimuth, where the joint descent begins too, and for 20 rounds: on all azimuths, to its
end, it takes minutes."""
STARTS = ("slices", "random-1")
"""Of independent-G, of the paper's eight."""
RESTARTS = 3
"""Of the plain simplexes, each from a random point."""
WIDE = {"p0": (1e-3, 1.0), "p1": (1e-2, 1e1), "p2": (1e-2, 1.0), "p3": (0.02, 0.98)}
"""Where the plain simplexes of GGX start; their bounds are the catalogue's."""


@dataclass(frozen=True, eq=False)
class Found:
    """What a method made of a case.

    ends:       (restarts, channels) final errors of its restarts, as far as it has any
    parameters: by formula and parameter, what each channel got, to compare with what is known
    """

    model: Model
    warnings: tuple[str, ...] = ()
    ends: Array | None = None
    parameters: Mapping[str, Mapping[str, tuple[float, ...]]] | None = None
    conditioning: tuple[Conditioning, ...] = ()


@dataclass(frozen=True)
class Method:
    """`run(case, seed)`; `seeded` where the seed changes what it does on the same case."""

    name: str
    meaning: str
    run: Callable[[Case, int], Found]
    seeded: bool = False


def _engine(name: str, case: Case, seed: int) -> Found:
    """The engine: linear parameters projected out, Nelder-Mead over the others, many starts, a last polish."""
    fitter, problem = published(name), _problem(case, seed)
    job = fitter.job(FitSettings())
    description, seconds = fit_formula(problem, job)
    fit = description.fit
    if not math.isfinite(fit.error):
        raise FittersError(f"{name} is not finite on every lit cell")
    return Found(
        formula_models(fitter.expression, fit, seconds)[0],
        description.warnings,
        restart_errors(fitter.expression, problem, job.intervals, job.settings),
        {name: {symbol: tuple(values.tolist()) for symbol, values in fit.columns.items()}},
        tuple(conditioning(fitter.expression, problem.fine, job.intervals, fit)),
    )


@lru_cache(maxsize=2)
def _problem(case: Case, seed: int) -> Problem:
    return Problem([case.measured], case.light, seed=seed).ready()


def _simplex(projected: bool, case: Case, seed: int) -> Found:
    """SciPy's Nelder-Mead on GGX from random points: over all parameters, or over the two that are not linear.

    Without multi-start of any finesse and without polish: what a fit is without the engine's care. The same
    points are used for both, so that their difference is what projection buys.
    """
    expression, problem = formula("ggx").expression, _problem(case, seed)
    random = np.random.default_rng((seed, 7))
    places = random.random((RESTARTS, len(WIDE)))
    low, high = np.log(np.array(list(WIDE.values()))).T
    begins = low + places * (high - low)
    ends, best = np.empty((RESTARTS, len(CHANNELS))), np.empty((len(CHANNELS), len(WIDE)))
    for channel in range(len(CHANNELS)):
        objective = _Objective(expression, problem, channel, projected)
        runs = [objective.descended(begin) for begin in begins]
        ends[:, channel] = [error for error, _ in runs]
        best[channel] = min(runs, key=lambda run: run[0])[1]
    named = {f"p{i}": tuple(best[:, i].tolist()) for i in range(len(WIDE))}
    return Found(FormulaModel(expression, best), (), ends, {"ggx": named})


class _Objective:
    """The error of GGX for one channel on the coarse part of the sample, in logarithms of its parameters."""

    def __init__(self, expression: Expression, problem: Problem, channel: int, projected: bool) -> None:
        self.expression, self.projected = expression, projected
        cells = problem.sample.coarse or problem.sample
        self.weights, self.targets = (rows[channel].astype(np.float64) for rows in (cells.weights, cells.targets))
        self.seen = {name: at[: len(self.weights)] for name, at in problem.sample.features.items()}
        self.low, self.high = np.log(np.array(list(formula("ggx").bounds.values()))).T

    def descended(self, begin: Array) -> tuple[float, Array]:
        """The error and all four parameters at the end of one descent."""
        start = begin[2:] if self.projected else begin
        options = {"maxfev": 200 * len(start), "xatol": 1e-6, "fatol": 1e-12}
        optimum = minimize(self._squares, start, method="Nelder-Mead", options=options)
        return math.sqrt(float(self._squares(optimum.x))), self._parameters(optimum.x)

    def _squares(self, x: Array) -> float:
        p = self._parameters(x)
        with np.errstate(all="ignore"):
            value = float(np.sum(np.square(self.weights * self._values(p) - self.targets)))
        return value if math.isfinite(value) else 1e300

    def _parameters(self, x: Array) -> Array:
        if not self.projected:
            return np.exp(np.clip(x, self.low, self.high))
        shape = np.exp(np.clip(x, self.low[2:], self.high[2:]))
        lobe = self.weights * self._values(np.array([0.0, 1.0, *shape]))
        columns = np.stack([self.weights, lobe], axis=1)
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        with np.errstate(all="ignore"):
            finite = np.all(np.isfinite(columns))
            c = np.linalg.lstsq(columns / scale, self.targets, rcond=None)[0] / scale if finite else np.ones(2)
        return np.array([*np.clip(c, np.exp(self.low[:2]), np.exp(self.high[:2])), *shape])

    def _values(self, p: Array) -> Array:
        return evaluate_features(self.expression, {f"p{i}": float(v) for i, v in enumerate(p)}, self.seen)


def _tabulated(name: str, case: Case, seed: int) -> Found:
    fit = material_fitter(name).of_material(case.measured)
    return Found(fit.model, fit.warnings)


def _power_iterations(case: Case, seed: int) -> Found:
    fit = material_fitter("power-iterations").of_material(case.measured)
    alpha = float(fit.details["alpha_ggx"])
    return Found(fit.model, fit.warnings, parameters={"ggx": {"p2": (alpha,) * len(CHANNELS)}})


def _joint_independent_g(case: Case, seed: int) -> Found:
    return _of_factors(case, fit_independent_g(case.measured, only=STARTS))


def _awls_independent_g(case: Case, seed: int) -> Found:
    every = starts(slices)
    chosen = {name: every[name] for name in STARTS}
    return _of_factors(case, fit_from_starts(case.measured, False, chosen, _thin_independent_g, MicrofacetFactors))


def _awls_g_from_d(case: Case, seed: int) -> Found:
    return _of_factors(
        case, fit_from_starts(case.measured, True, {"slices": slices}, _thin_g_from_d, SmithFactors)
    )


def _awls_naive(case: Case, seed: int) -> Found:
    return _of_factors(case, fit_naive(case.measured, solver="awls"))


def _thin_independent_g(samples: Samples, start: Channel) -> Solved:
    return solving.alternate_independent_g(samples.every(THIN), start, THIN_ROUNDS)


def _thin_g_from_d(samples: Samples, start: Channel) -> Solved:
    return solving.alternate_g_from_d(samples.every(THIN), start, THIN_ROUNDS)


def _of_factors(case: Case, fit: FactorFit) -> Found:
    # Objectives are squares; ends are compared as errors.
    ends = np.sqrt([start.objective for start in fit.starts])
    return Found(fit.model, (*case.measured.doubts, *fit.warnings), ends)


_THINNED = f"AWLS on every {THIN}th azimuth for {THIN_ROUNDS} rounds"

METHODS: Mapping[str, Method] = {
    method.name: method
    for method in (
        *(
            Method(name, "the engine: variable projection, Nelder-Mead, many starts", partial(_engine, name), True)
            for name in ("ggx", "cook-torrance", "abc")
        ),
        Method("simplex", "GGX, SciPy's Nelder-Mead over all parameters", partial(_simplex, False), True),
        Method("simplex-projected", "the same, linear parameters projected out", partial(_simplex, True), True),
        Method("npf-independent-g", f"joint descent, starts {', '.join(STARTS)}", _joint_independent_g),
        Method("npf-g-from-d", "joint descent", partial(_tabulated, "npf-g-from-d")),
        Method("npf-naive", "joint descent", partial(_tabulated, "npf-naive")),
        Method("awls-independent-g", f"{_THINNED}, starts {', '.join(STARTS)}", _awls_independent_g),
        Method("awls-g-from-d", _THINNED, _awls_g_from_d),
        Method("awls-naive", "AWLS to its end", _awls_naive),
        Method("power-iterations", "the distribution from backscattering alone", _power_iterations),
        Method("bivariate", "weighted means over the azimuth", partial(_tabulated, "bivariate")),
    )
}
