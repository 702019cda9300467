"""The factors of one colour channel, between the solvers' forms and the tables that are kept."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fitters.grid import SHAPE, Array
from fitters.models.factors.alternation import FLOOR, Mask, filled
from fitters.models.factors.samples import NODES, SampleGeometry, Samples


@dataclass(frozen=True, eq=False)
class Channel:
    """rho_d, rho_s in sr^-1, D (90,), F (90,) and G (90,), or H (180,) in its place; largest components 1."""

    rho_d: float
    rho_s: float
    d: Array
    f: Array
    g: Array

    def normalised(self) -> "Channel":
        """The same model, where rho_s takes up the factors' scales; a factor of zeros becomes ones."""
        d, f, g = (np.maximum(x, 0.0) if x.max() > 0 else np.ones_like(x) for x in (self.d, self.f, self.g))
        power = 2 if len(g) == NODES else 1
        scale = d.max() * f.max() * g.max() ** power
        return Channel(self.rho_d, self.rho_s * scale, d / d.max(), f / f.max(), g / g.max())

    def clamped(self) -> "Channel":
        """Normalised, and no component below the dynamic range (section 4.3 of Bagher et al. 2016)."""
        n = self.normalised()
        return Channel(n.rho_d, n.rho_s, *(np.maximum(x, FLOOR) for x in (n.d, n.f, n.g)))

    def unknowns(self) -> Array:
        """rho_d, log rho_s D, log F, log G: what the descent works on."""
        c = self.clamped()
        return np.concatenate([[c.rho_d], np.log(max(c.rho_s, 1e-300) * c.d), np.log(c.f), np.log(c.g)])

    @classmethod
    def of_unknowns(cls, x: Array, g: Array | None = None) -> "Channel":
        """From the descent's unknowns; `g` where they do not hold it."""
        d, f = np.exp(x[1:91]), np.exp(x[91:181])
        return cls(float(x[0]), 1.0, d, f, np.exp(x[181:]) if g is None else g).normalised()

    def filled(self, seen: "Seen") -> "Channel":
        """With the components that no sample sees set from their neighbours, beyond the last one held.

        So is F in the last bin, 89 to 90 degrees, where every direction lies beyond 89 degrees, and D likewise.
        """
        return Channel(
            self.rho_d, self.rho_s, filled(self.d, seen.d), filled(self.f, seen.f), filled(self.g, seen.g)
        ).normalised()


@dataclass(frozen=True, eq=False)
class Seen:
    """Which components of the factors some sample sees: masks like those of `Channel`."""

    d: Mask
    f: Mask
    g: Mask


@lru_cache(maxsize=8)
def seen(samples: Samples, *, by_azimuth: bool) -> Seen:
    """The components that samples of any weight see; `by_azimuth` for H in the place of G."""
    if samples.weights.all():
        return _seen_by_all(samples.geometry, by_azimuth)
    return _seen(samples.geometry, samples.weights > 0, by_azimuth)


@lru_cache(maxsize=8)
def _seen_by_all(at: SampleGeometry, by_azimuth: bool) -> Seen:
    return _seen(at, np.ones(len(at), np.bool_), by_azimuth)


def _seen(at: SampleGeometry, weighty: Mask, by_azimuth: bool) -> Seen:
    counts = np.bincount(at.row[weighty], minlength=SHAPE[0] * SHAPE[1]).reshape(SHAPE[:2])
    if by_azimuth:
        last = np.bincount(at.azimuth[weighty], minlength=at.phi.size) > 0
    else:
        nodes = np.concatenate([n[weighty].astype(int) + k for n in (at.node_i, at.node_o) for k in (0, 1)])
        last = np.bincount(nodes, minlength=NODES) > 0
    return Seen(np.any(counts, axis=1), np.any(counts, axis=0), last)
