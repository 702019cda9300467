"""Factor models fitted to a material: every channel alone, from one start or several, by either solver."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from fitters.errors import FittersError
from fitters.factors import solving
from fitters.factors.alternation import Sums, azimuthal_sums
from fitters.factors.channel import Channel
from fitters.factors.samples import Samples, samples
from fitters.factors.solving import Solved
from fitters.factors.starts import Start, slices, starts
from fitters.factors.tables import BivariateTable, MicrofacetFactors, NaiveFactors, SmithFactors
from fitters.fits.problem import CHANNELS
from fitters.grid import SHAPE, Array
from fitters.materials import Material
from fitters.materials.synthetic import matte
from fitters.models import Model

Solver = Literal["joint", "awls"]
PerChannel = tuple[float, float, float]
T = TypeVar("T")

SPREAD = 0.01
"""Starts that end further apart than this share of the objective are reported."""


@dataclass(frozen=True)
class StartReport:
    """One start: objective (eq. 7), steps or rounds and golden-section searches per channel; seconds for all."""

    name: str
    objective: PerChannel
    iterations: tuple[int, int, int]
    searches: tuple[int, int, int]
    seconds: float
    converged: bool


@dataclass(frozen=True, eq=False)
class FactorFit:
    """A fitted model, its objective (eq. 7) per channel, what every start reached, and what a user should know."""

    model: Model
    objective: PerChannel
    starts: tuple[StartReport, ...]
    warnings: tuple[str, ...]

    @property
    def spread(self) -> PerChannel:
        """How far above the best start the worst ended, relative, per channel."""
        ends = [[start.objective[c] for start in self.starts] for c in range(3)]
        r, g, b = (max(end) / max(min(end), 1e-300) - 1 for end in ends)
        return r, g, b


def fit_independent_g(
    material: Material, *, solver: Solver = "joint", only: tuple[str, ...] | None = None
) -> FactorFit:
    """The independent-G model (eq. 3) from the paper's eight starts, or from those named; the best per channel.

    Raises `FittersError` where a material has no sample, or for a start that there is none of.
    """
    chosen = starts(lambda channel: solving.descend_g_from_d(channel, slices(channel)).channel)
    unknown = set(only or ()) - set(chosen)
    if unknown:
        raise FittersError(f"no start called {', '.join(sorted(unknown))}: there are {', '.join(chosen)}")
    if only is not None:
        chosen = {name: chosen[name] for name in only}
    if solver == "awls":
        return _fit(material, False, chosen, solving.alternate_independent_g, MicrofacetFactors)
    return _fit(material, True, chosen, solving.descend_independent_g, MicrofacetFactors)


def fit_g_from_d(material: Material, *, solver: Solver = "joint") -> FactorFit:
    """Eq. 3 with Smith's G of D (section 4.3), from one start: it is stable (section 5)."""
    solve = solving.alternate_g_from_d if solver == "awls" else solving.descend_g_from_d
    return _fit(material, True, {"slices": slices}, solve, SmithFactors)


def fit_naive(material: Material, *, solver: Solver = "joint") -> FactorFit:
    """The naive model (eq. 4)."""
    solve = solving.alternate_naive if solver == "awls" else solving.descend_naive
    return _fit(material, False, {"slices": slices}, solve, NaiveFactors)


def fit_bivariate(material: Material) -> FactorFit:
    """The bivariate model (eq. 5): weighted means over the azimuths, in one step.

    A cell of (theta_half, theta_diff) without a sample takes the value of the nearest smaller theta_diff.
    """
    _loaded(_means, True)
    began = time.perf_counter()
    table, objective = np.zeros((*SHAPE[:2], 3)), []
    for c, channel in enumerate(samples(material)):
        known = _means(channel)
        sampled = known.w > 0
        table[..., c] = _carried(known.wz / np.where(sampled, known.w, 1.0), sampled)
        left = known.wzz - np.where(sampled, known.wz, 0.0) ** 2 / np.where(sampled, known.w, 1.0)
        objective.append(float(left.sum()) + channel.constant)
    model = BivariateTable(B=table)
    model.fit_seconds = time.perf_counter() - began
    reached = _per_channel(objective)
    report = StartReport("one step", reached, (1, 1, 1), (0, 0, 0), model.fit_seconds, True)
    return FactorFit(model, reached, (report,), ())


def _means(channel: Samples, start: Channel | None = None) -> Sums:
    """What the weighted means are made of; they need no start."""
    return azimuthal_sums(channel, np.ones(channel.geometry.phi.size))


@cache
def _loaded(solve: Callable[[Samples, Channel], object], folded: bool) -> None:
    """Runs a solver once on a matte channel: no fit's seconds count the compiling and loading of code."""
    channel = samples(matte(), folded=folded)[0]
    solve(channel, slices(channel))


def _fit(
    material: Material,
    folded: bool,
    chosen: Mapping[str, Start],
    solve: Callable[[Samples, Channel], Solved],
    table: type[MicrofacetFactors] | type[NaiveFactors],
) -> FactorFit:
    _loaded(solve, folded)
    began = time.perf_counter()
    channels = samples(material, folded=folded)
    weighing = time.perf_counter() - began
    best: list[Solved] = []
    reports = []
    for name, start in chosen.items():
        started = time.perf_counter()
        ends = [solve(channel, start(channel)) for channel in channels]
        best = [min(pair, key=lambda end: end.objective) for pair in zip(best or ends, ends, strict=True)]
        reports.append(
            StartReport(
                name,
                _per_channel([end.objective for end in ends]),
                _per_channel([end.iterations for end in ends]),
                _per_channel([end.searches for end in ends]),
                weighing + time.perf_counter() - started,
                all(end.converged for end in ends),
            )
        )
    model = _tables(table, [end.channel for end in best])
    model.fit_seconds = time.perf_counter() - began
    fit = FactorFit(model, _per_channel([end.objective for end in best]), tuple(reports), ())
    return FactorFit(fit.model, fit.objective, fit.starts, _warnings(fit))


def _tables(table: type[MicrofacetFactors] | type[NaiveFactors], channels: list[Channel]) -> Model:
    last = "H" if table is NaiveFactors else "G"
    return table(
        rho_d=np.array([c.rho_d for c in channels]),
        rho_s=np.array([c.rho_s for c in channels]),
        D=np.stack([c.d for c in channels], axis=1),
        F=np.stack([c.f for c in channels], axis=1),
        **{last: np.stack([c.g for c in channels], axis=1)},
    )


def _warnings(fit: FactorFit) -> tuple[str, ...]:
    found = [
        f"{channel}: starts end up to {100 * spread:.1f} % apart, so that other factors explain it about as well"
        for channel, spread in zip(CHANNELS, fit.spread, strict=True)
        if spread > SPREAD
    ]
    unfinished = [start.name for start in fit.starts if not start.converged]
    if unfinished:
        found.append(f"still falling when its iterations were used up: {', '.join(unfinished)}")
    return tuple(found)


def _carried(values: Array, known: NDArray[np.bool_]) -> Array:
    """Values (90, 90) with those not known taken from the last known one before, along theta_diff."""
    last = np.maximum.accumulate(np.where(known, np.arange(SHAPE[1]), -1), axis=1)
    carried = np.take_along_axis(values, np.maximum(last, 0), axis=1)
    return np.where(last >= 0, carried, 0.0)


def _per_channel(values: Iterable[T]) -> tuple[T, T, T]:
    r, g, b = values
    return r, g, b
