"""The factors of one channel from one start: by the descent that converges, or by the paper's alternation."""

from dataclasses import dataclass, replace

import numpy as np

from fitters.models.factors import awls
from fitters.models.factors.alternation import Sums, alternate, azimuthal_sums, shadowed_sums
from fitters.models.factors.channel import Channel, seen
from fitters.models.factors.descent import Descent, LogProblem, descend
from fitters.models.factors.problems import GFromD, IndependentG, Naive
from fitters.models.factors.samples import NODES, Samples
from fitters.models.factors.smith import smith

SWEEPS = 10
"""Rounds of alternation on D and F before a descent."""
STRIDE = 15
"""A descent of independent-G and G-from-D begins on every 15th azimuth."""
COARSE_STEPS, FINE_STEPS, TOLERANCE = 100, 60, 1e-4
FIRST_TOLERANCE = 1e-3
"""Of the descent before log G is disturbed."""
SHAKES, SHAKE, SHAKE_SEED = 2, 1.0, 1910
"""How often log G is disturbed, by normal noise of which deviation; the lower end is kept: neighbouring nodes of G
and bins of F can hold each other where a descent gets no further."""
SMOOTHING = 1e-8
"""Weight of the squared second differences of log G, in units of the weighted squared measurement."""
ROUNDS, ROUND_TOLERANCE = 300, 1e-5
"""Rounds of the paper's alternation at most, and the relative gain of a round at which it ends."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Factors, the objective (eq. 7) they reach on all samples, steps or rounds, golden-section searches."""

    channel: Channel
    objective: float
    iterations: int
    searches: int
    converged: bool


def descend_independent_g(samples: Samples, start: Channel) -> Solved:
    """Eq. 3 with a free G: on some azimuths first, disturbed and resumed there, then on all."""
    coarse = samples.every(STRIDE)
    problem = IndependentG(coarse, SMOOTHING * samples.square / STRIDE)
    begin = _warmed(coarse, start).unknowns()
    best = descend(problem, begin, iterations=COARSE_STEPS, tolerance=FIRST_TOLERANCE)
    steps = best.iterations
    random = np.random.default_rng(SHAKE_SEED)
    for _ in range(SHAKES):
        disturbed = best.x.copy()
        disturbed[-NODES:] += SHAKE * random.standard_normal(NODES)
        again = descend(problem, disturbed, iterations=COARSE_STEPS, tolerance=TOLERANCE)
        steps += again.iterations
        best = min(best, again, key=lambda end: end.objective)
    fine = IndependentG(samples, SMOOTHING * samples.square)
    last = descend(fine, best.x, iterations=FINE_STEPS, tolerance=TOLERANCE)
    solved = _solved(replace(fine, smoothing=0.0), last, Channel.of_unknowns(last.x))
    return replace(solved, iterations=steps + last.iterations)


def descend_g_from_d(samples: Samples, start: Channel) -> Solved:
    """Eq. 3 with Smith's G of D."""
    coarse, shadow = samples.every(STRIDE), smith()
    begin = _warmed(coarse, replace(start, g=np.ones(NODES)))
    first = descend(
        GFromD(coarse, shadow), begin.unknowns()[:-NODES], iterations=COARSE_STEPS, tolerance=TOLERANCE
    )
    problem = GFromD(samples, shadow)
    last = descend(problem, first.x, iterations=FINE_STEPS, tolerance=TOLERANCE)
    solved = _solved(problem, last, Channel.of_unknowns(last.x, np.ones(NODES)))
    return replace(solved, channel=_shadowed(solved.channel), iterations=first.iterations + last.iterations)


def descend_naive(samples: Samples, start: Channel) -> Solved:
    """Eq. 4, on samples that are not folded."""
    flat = replace(start, g=np.ones(samples.geometry.phi.size))
    known = azimuthal_sums(samples, flat.g)
    problem = Naive(samples)
    last = descend(problem, _alternated(known, flat).unknowns(), iterations=COARSE_STEPS, tolerance=TOLERANCE)
    return _solved(problem, last, Channel.of_unknowns(last.x))


def alternate_independent_g(samples: Samples, start: Channel, rounds: int | None = None) -> Solved:
    """Independent-G by the paper's alternation, on samples that are not folded."""
    return _of_alternation(
        samples, awls.alternate_independent_g(samples, start, rounds=rounds or ROUNDS, tolerance=ROUND_TOLERANCE)
    )


def alternate_g_from_d(samples: Samples, start: Channel, rounds: int | None = None) -> Solved:
    """G-from-D, likewise, on any samples."""
    solved = _of_alternation(
        samples,
        awls.alternate_g_from_d(samples, smith(), start, rounds=rounds or ROUNDS, tolerance=ROUND_TOLERANCE),
    )
    return replace(solved, channel=_shadowed(solved.channel))


def alternate_naive(samples: Samples, start: Channel, rounds: int | None = None) -> Solved:
    """The naive model, likewise, on samples that are not folded."""
    flat = replace(start, g=np.ones(samples.geometry.phi.size))
    return _of_alternation(
        samples, awls.alternate_naive(samples, flat, rounds=rounds or ROUNDS, tolerance=ROUND_TOLERANCE)
    )


def _warmed(samples: Samples, start: Channel) -> Channel:
    """The start after rounds of linear steps on D and F, which leave places where a descent would stay."""
    begin = start.clamped()
    return _alternated(shadowed_sums(samples, begin.g), begin)


def _alternated(known: Sums, start: Channel) -> Channel:
    begin = start.clamped()
    rho_d, rho_s, d, f = alternate(known, begin.d, begin.f, SWEEPS)
    if rho_s <= 0:
        # The start's lobe explains nothing: a flat one does, or is at least there to be changed.
        rho_d, rho_s, d, f = alternate(known, np.ones_like(begin.d), np.ones_like(begin.f), SWEEPS)
    return Channel(rho_d, rho_s or 1e-3 * max(rho_d, 1e-6), d, f, begin.g)


def _shadowed(channel: Channel) -> Channel:
    """The channel with Smith's G of its D."""
    return replace(channel, g=smith().shadowing(np.maximum(channel.d, 1e-300)))


def _solved(problem: LogProblem, end: Descent, channel: Channel) -> Solved:
    samples = problem.samples
    filled = channel.filled(seen(samples, by_azimuth=isinstance(problem, Naive)))
    return Solved(filled, problem.objective(end.x) + samples.constant, end.iterations, 0, end.converged)


def _of_alternation(samples: Samples, end: awls.Alternation) -> Solved:
    by_azimuth = len(end.channel.g) != NODES
    filled = end.channel.filled(seen(samples, by_azimuth=by_azimuth))
    return Solved(filled, end.objective + samples.constant, end.rounds, end.searches, end.converged)
