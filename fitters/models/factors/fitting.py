"""Factor models fitted to a material: every channel alone, from one start or several, by either solver."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal, TypeVar

import numpy as np

from fitters.errors import FittersError
from fitters.grid import CHANNELS, SHAPE, Array
from fitters.materials import Material
from fitters.materials.synthetic import matte
from fitters.models.factors import solving
from fitters.models.factors.alternation import Mask, Sums, azimuthal_sums, filled
from fitters.models.factors.channel import Channel, seen
from fitters.models.factors.descent import NEGLIGIBLE
from fitters.models.factors.samples import NODES, Samples, samples
from fitters.models.factors.solving import Solved
from fitters.models.factors.starts import Start, slices, starts
from fitters.models.factors.tables import BivariateTable, MicrofacetFactors, NaiveFactors, SmithFactors
from fitters.models.model import Model

Solver = Literal["joint", "awls"]
PerChannel = tuple[float, float, float]
T = TypeVar("T")

GAPS = 5
"""Components of a factor that may lack samples without a warning; the outermost often do."""

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
    def kept(self) -> tuple[StartReport, StartReport, StartReport]:
        """The start that each channel's factors are of."""
        r, g, b = (min(self.starts, key=lambda start: start.objective[c]) for c in range(3))
        return r, g, b

    @property
    def spread(self) -> PerChannel:
        """How far above the best start the worst ended, relative, per channel; 0 where the best is exact."""
        ends = [[start.objective[c] for start in self.starts] for c in range(3)]
        r, g, b = (max(end) / min(end) - 1 if min(end) > 0 else 0.0 for end in ends)
        return r, g, b


def fit_independent_g(
    material: Material, *, solver: Solver = "joint", only: tuple[str, ...] | None = None
) -> FactorFit:
    """The independent-G model (eq. 3) from the paper's eight starts, or from those named; the best per channel.

    Raises `FittersError` where a material has no sample, or for a start that there is none of.
    """
    from_d = solving.alternate_g_from_d if solver == "awls" else solving.descend_g_from_d
    chosen = starts(lambda channel: from_d(channel, slices(channel)).channel)
    unknown = set(only or ()) - set(chosen)
    if unknown:
        raise FittersError(f"no start called {', '.join(sorted(unknown))}: there are {', '.join(chosen)}")
    if only is not None:
        chosen = {name: chosen[name] for name in only}
    if solver == "awls":
        return fit_from_starts(material, False, chosen, solving.alternate_independent_g, MicrofacetFactors)
    return fit_from_starts(material, True, chosen, solving.descend_independent_g, MicrofacetFactors)


def fit_g_from_d(material: Material, *, solver: Solver = "joint") -> FactorFit:
    """Eq. 3 with Smith's G of D (section 4.3), from one start: it is stable (section 5)."""
    solve = solving.alternate_g_from_d if solver == "awls" else solving.descend_g_from_d
    return fit_from_starts(material, True, {"slices": slices}, solve, SmithFactors)


def fit_naive(material: Material, *, solver: Solver = "joint") -> FactorFit:
    """The naive model (eq. 4)."""
    solve = solving.alternate_naive if solver == "awls" else solving.descend_naive
    return fit_from_starts(material, False, {"slices": slices}, solve, NaiveFactors)


def fit_bivariate(material: Material) -> FactorFit:
    """The bivariate model (eq. 5): weighted means over the azimuths, in one step.

    A cell of (theta_half, theta_diff) without a sample takes its value along theta_diff from those that have one,
    beyond the outermost the same; a theta_half without any takes that of the one before.
    """
    _loaded(_means, True)
    began = time.perf_counter()
    table, objective, channels = np.zeros((*SHAPE[:2], 3)), [], samples(material)
    for c, channel in enumerate(channels):
        known = _means(channel)
        sampled = known.w > 0
        table[..., c] = _spread_out(known.wz / np.where(sampled, known.w, 1.0), sampled)
        left = known.wzz - np.where(sampled, known.wz, 0.0) ** 2 / np.where(sampled, known.w, 1.0)
        objective.append(float(left.sum()) + channel.constant)
    model = BivariateTable(B=table)
    model.fit_seconds = time.perf_counter() - began
    reached = _per_channel(objective)
    report = StartReport("one step", reached, (1, 1, 1), (0, 0, 0), model.fit_seconds, True)
    return FactorFit(model, reached, (report,), _about_zeros(channels))


def _means(channel: Samples, start: Channel | None = None) -> Sums:
    """What the weighted means are made of; they need no start."""
    return azimuthal_sums(channel, np.ones(channel.geometry.phi.size))


@cache
def _loaded(solve: Callable[[Samples, Channel], object], folded: bool) -> None:
    """Runs a solver once on a matte channel: no fit's seconds count the compiling and loading of code."""
    channel = samples(matte(), folded=folded)[0]
    solve(channel, slices(channel))


def fit_from_starts(
    material: Material,
    folded: bool,
    chosen: Mapping[str, Start],
    solve: Callable[[Samples, Channel], Solved],
    table: type[MicrofacetFactors] | type[NaiveFactors],
) -> FactorFit:
    """Every channel solved from every start, the best kept. Raises `FittersError` where there is no sample."""
    _loaded(solve, folded)
    began = time.perf_counter()
    channels = samples(material, folded=folded)
    weighing = time.perf_counter() - began
    best: list[Solved] = []
    reports = []
    for name, start in chosen.items():
        started = time.perf_counter()
        ends = [
            _solved(solve, start, channel, SHAPE[2] if table is NaiveFactors else NODES) for channel in channels
        ]
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
    gaps = _about_gaps(channels, table is NaiveFactors)
    return replace(fit, warnings=_about_zeros(channels) + gaps + _warnings(fit))


def _solved(solve: Callable[[Samples, Channel], Solved], start: Start, channel: Samples, last: int) -> Solved:
    """A channel's factors from a start; what is black has no factors."""
    if channel.square > 0:
        solved = solve(channel, start(channel))
        exact = solved.objective <= NEGLIGIBLE * channel.square
        return replace(solved, objective=0.0) if exact else solved
    return Solved(Channel(0.0, 0.0, np.ones(90), np.ones(90), np.ones(last)), 0.0, 0, 0, True)


def _about_zeros(channels: list[Samples]) -> tuple[str, ...]:
    return tuple(
        f"{name}: half of the measurement or more is 0; bright values are weighted by the median of the rest"
        for name, channel in zip(CHANNELS, channels, strict=True)
        if channel.mostly_zero
    )


def _about_gaps(channels: list[Samples], by_azimuth: bool) -> tuple[str, ...]:
    """Of components that no sample sees: they follow their neighbours."""
    has = seen(channels[0], by_azimuth=by_azimuth)
    parts = {"D": has.d, "F": has.f, "H" if by_azimuth else "G": has.g}
    blind = {name: int(np.count_nonzero(~mask)) for name, mask in parts.items()}
    named = [f"{count} of {len(parts[name])} of {name}" for name, count in blind.items() if count > GAPS]
    return (f"no sample sees {', '.join(named)}: extrapolated from the others",) if named else ()


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
    sentences = [
        f"{channel}: starts end up to {100 * spread:.1f} % apart, so that other factors explain it about as well"
        for channel, spread in zip(CHANNELS, fit.spread, strict=True)
        if spread > SPREAD
    ]
    unfinished = [start.name for start in fit.starts if not start.converged]
    if unfinished:
        sentences.append(f"still falling when its iterations were used up: {', '.join(unfinished)}")
    return tuple(sentences)


def _spread_out(values: Array, known: Mask) -> Array:
    """Values (90, 90) with those not known taken from others: along each row, then from the row before."""
    full = np.zeros_like(values)
    for row in range(len(values)):
        if known[row].any():
            full[row] = filled(values[row], known[row])
        elif row > 0:
            full[row] = full[row - 1]
    return full


def _per_channel(values: Iterable[T]) -> tuple[T, T, T]:
    r, g, b = values
    return r, g, b
