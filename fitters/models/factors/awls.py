"""Alternating weighted least squares as Bagher et al. 2016 describe it (sections 4.2 and 4.3).

Each factor in turn gets its best values with all else held; then rho_d and rho_s. Where clamping, smoothing or the
dependence of G on D would make the objective rise, a golden-section search along the update finds where it falls.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import gaussian_filter1d

from fitters import compiled
from fitters.grid import Array
from fitters.models.factors.alternation import FLOOR, Sums, azimuthal_sums, shadowed_sums
from fitters.models.factors.channel import Channel
from fitters.models.factors.samples import NODES, Samples
from fitters.models.factors.smith import Smith

SMOOTHING = 1.0
"""Standard deviation, in nodes, of the Gaussian that smooths G after an update."""
G_UPDATES = 10
"""Updates of G in a round at most; they end where one would not lower the objective."""
SECTIONS = 20
"""Steps of a golden-section search."""


@dataclass(frozen=True, eq=False)
class Alternation:
    """Where the alternation ended: factors, the objective after every single update, rounds, searches."""

    channel: Channel
    course: tuple[float, ...]
    rounds: int
    searches: int
    converged: bool

    @property
    def objective(self) -> float:
        return self.course[-1]


def alternate_independent_g(samples: Samples, start: Channel, *, rounds: int, tolerance: float) -> Alternation:
    """Independent-G from a start, on samples that are not folded (G_i and G_o have separate updates)."""
    return _alternate(_IndependentG(samples), start, rounds, tolerance)


def alternate_g_from_d(
    samples: Samples, smith: Smith, start: Channel, *, rounds: int, tolerance: float
) -> Alternation:
    """G-from-D from a start; negative components are clamped to 0, without a dynamic range."""
    return _alternate(_GFromD(samples, smith), start, rounds, tolerance)


def alternate_naive(samples: Samples, start: Channel, *, rounds: int, tolerance: float) -> Alternation:
    """The naive model from a start, on samples that are not folded."""
    return _alternate(_Naive(samples), start, rounds, tolerance)


class _Course:
    """The objective of a model after every update; an update is taken where it does not rise."""

    def __init__(self, model: "_Model", start: Channel):
        self.model, self.channel = model, start
        self.values, self.searches = [model.objective(start)], 0

    def take(self, trial: Channel, *, search: bool = True) -> bool:
        """Goes to `trial`, or to the lowest point on the way there; False where that is no way down."""
        value = self.model.objective(trial)
        if value > self.values[-1] and search:
            self.searches += 1
            trial, value = _golden(self.model, self.channel, trial)
        falls = value <= self.values[-1]
        if falls:
            self.channel = trial
            self.values.append(value)
        return falls


class _Model:
    """What the models' alternations share, for a model whose third factor is G."""

    floor = FLOOR

    def __init__(self, samples: Samples):
        self.samples = samples
        self._last: tuple[Array, Sums] | None = None

    def sums(self, channel: Channel) -> Sums:
        """The sums for a channel's third factor; those of the last one are remembered."""
        if self._last is None or not np.array_equal(self._last[0], channel.g):
            self._last = (channel.g.copy(), self._sums(channel.g))
        return self._last[1]

    def _sums(self, g: Array) -> Sums:
        return shadowed_sums(self.samples, g)

    def with_d(self, channel: Channel, d: Array) -> Channel:
        """The channel with another D, and all that follows from D."""
        return replace(channel, d=d)

    def objective(self, channel: Channel) -> float:
        return self.sums(channel).objective(channel.rho_d, channel.rho_s, channel.d, channel.f)

    def last(self, course: _Course) -> None:
        """The updates of a round that follow those of D and F."""


class _IndependentG(_Model):
    def last(self, course: _Course) -> None:
        """Updates G until that would make the objective rise; searches only where the first update would."""
        for update in range(G_UPDATES):
            before = course.values[-1]
            g = gaussian_filter1d(self._best_g(course.channel), SMOOTHING, mode="nearest")
            trial = replace(course.channel, g=np.maximum(g, FLOOR * g.max())).normalised()
            trial = replace(trial, g=np.maximum(trial.g, FLOOR))
            if not course.take(trial, search=update == 0) or before - course.values[-1] < 1e-4 * before:
                return

    def _best_g(self, c: Channel) -> Array:
        """The mean of the best G_i with G_o held and of the best G_o with G_i held."""
        at, solutions = self.samples.geometry, []
        for own, part, other, other_part in (
            (at.node_i, at.part_i, at.node_o, at.part_o),
            (at.node_o, at.part_o, at.node_i, at.part_i),
        ):
            bands, right = np.zeros((2, NODES)), np.zeros(NODES)
            _g_equations(
                c.rho_d, c.rho_s, c.d, c.f, c.g, at.offset, own, part, other, other_part, at.cosines,
                self.samples.weights, self.samples.values, bands, right,
            )  # fmt: skip
            unseen = bands[1] <= 1e-12 * bands[1].max()
            bands[1][unseen], right[unseen] = 1.0, c.g[unseen]
            bands[0][unseen] = 0.0
            bands[0][1:][unseen[:-1]] = 0.0
            solutions.append(np.maximum(solveh_banded(bands, right), 0.0))
        return (solutions[0] + solutions[1]) / 2


class _GFromD(_Model):
    floor = 0.0

    def __init__(self, samples: Samples, smith: Smith):
        super().__init__(samples)
        self.smith = smith

    def with_d(self, channel: Channel, d: Array) -> Channel:
        return replace(channel, d=d, g=self.smith.shadowing(np.maximum(d, 1e-300)))


class _Naive(_Model):
    def _sums(self, g: Array) -> Sums:
        return azimuthal_sums(self.samples, g)

    def last(self, course: _Course) -> None:
        """H by eq. 14."""
        c, s, at = course.channel, self.samples, self.samples.geometry
        q = (c.rho_s * np.outer(c.d, c.f)).ravel()[at.row]
        wq = s.weights * q
        top = np.bincount(at.azimuth, wq * (s.values - c.rho_d), len(c.g))
        bottom = np.bincount(at.azimuth, wq * q, len(c.g))
        h = np.where(bottom > 1e-300, top / np.maximum(bottom, 1e-300), c.g)
        course.take(replace(c, g=np.maximum(h, FLOOR * h.max())).normalised())


def _alternate(model: _Model, start: Channel, rounds: int, tolerance: float) -> Alternation:
    begin = model.with_d(start.clamped(), start.clamped().d)
    rho_d, rho_s = model.sums(begin).coefficients(begin.d, begin.f)
    course = _Course(model, replace(begin, rho_d=rho_d, rho_s=rho_s))
    for done in range(1, rounds + 1):
        before = course.values[-1]
        known, c = model.sums(course.channel), course.channel
        d = known.best_d(c.rho_d, c.rho_s or 1.0, c.d, c.f, model.floor)
        course.take(model.with_d(replace(c, rho_s=c.rho_s or 1.0), d).normalised())
        known, c = model.sums(course.channel), course.channel
        f = known.best_f(c.rho_d, c.rho_s or 1.0, c.d, c.f, model.floor)
        course.take(replace(c, rho_s=c.rho_s or 1.0, f=f).normalised())
        model.last(course)
        known, c = model.sums(course.channel), course.channel
        rho_d, rho_s = known.coefficients(c.d, c.f)
        course.take(replace(c, rho_d=rho_d, rho_s=rho_s))
        if before - course.values[-1] <= tolerance * before:
            return Alternation(course.channel, tuple(course.values), done, course.searches, True)
    return Alternation(course.channel, tuple(course.values), rounds, course.searches, False)


def _golden(model: _Model, here: Channel, there: Channel) -> tuple[Channel, float]:
    """The lowest point of a golden-section search on the line from `here` to `there`."""

    def at(t: float) -> Channel:
        between = Channel(
            here.rho_d + t * (there.rho_d - here.rho_d),
            here.rho_s + t * (there.rho_s - here.rho_s),
            *(a + t * (b - a) for a, b in ((here.d, there.d), (here.f, there.f), (here.g, there.g))),
        )
        return model.with_d(between, between.d)

    ratio = (np.sqrt(5) - 1) / 2
    low, high = 0.0, 1.0
    inner = [high - ratio * (high - low), low + ratio * (high - low)]
    values = [model.objective(at(t)) for t in inner]
    for _ in range(SECTIONS):
        if values[0] < values[1]:
            high, inner, values = inner[1], [0.0, inner[0]], [0.0, values[0]]
            inner[0] = high - ratio * (high - low)
            values[0] = model.objective(at(inner[0]))
        else:
            low, inner, values = inner[0], [inner[1], 0.0], [values[1], 0.0]
            inner[1] = low + ratio * (high - low)
            values[1] = model.objective(at(inner[1]))
    best = int(values[1] < values[0])
    return at(inner[best]), values[best]


@compiled.entry(fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")
def _g_equations(
    rho_d, rho_s, d, f, g, offset, node, part, other, other_part, cosines, weights, values, bands, right
):
    """Adds up the equations of G at `node` with G at `other` held: the band above the diagonal, the diagonal."""
    for row in range(len(offset) - 1):
        base = rho_s * d[row // 90] * f[row % 90]
        for j in range(offset[row], offset[row + 1]):
            a, b, t = node[j], other[j], part[j]
            y = base * (g[b] + other_part[j] * (g[b + 1] - g[b])) / cosines[j]
            wy = weights[j] * y
            wyy, wyz = wy * y, wy * (values[j] - rho_d)
            bands[1, a] += wyy * (1.0 - t) * (1.0 - t)
            bands[1, a + 1] += wyy * t * t
            bands[0, a + 1] += wyy * (1.0 - t) * t
            right[a] += wyz * (1.0 - t)
            right[a + 1] += wyz * t
