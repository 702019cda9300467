"""Where fits of independent-G begin: the eight starts of Bagher et al. 2016, section 5."""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.optimize import least_squares

from fitters.grid import Array, bin_centres
from fitters.models.factors.alternation import FLOOR, azimuthal_sums
from fitters.models.factors.channel import Channel
from fitters.models.factors.samples import NODES, Samples

RANDOM_STARTS = 4
SEED = 2016

Start = Callable[[Samples], Channel]


def _ones(samples: Samples) -> Channel:
    return Channel(0.0, 1.0, np.ones(90), np.ones(90), np.ones(NODES))


def _random(number: int) -> Start:
    def start(samples: Samples) -> Channel:
        d, f, g = np.random.default_rng((SEED, number)).random((3, 90))
        return Channel(0.0, 1.0, d, f, g)

    return start


def slices(samples: Samples) -> Channel:
    """D as the retro-reflective slice (theta_diff = 0), F as the slice of theta_half = 0, G = 1."""
    known = azimuthal_sums(samples, np.ones(samples.geometry.phi.size))
    mean = known.wz / np.maximum(known.w, 1e-300)
    d, f = mean[:, 0], mean[0]
    return Channel(0.0, 1.0, np.maximum(d, FLOOR * d.max()), np.maximum(f, FLOOR * f.max()), np.ones(NODES))


SGD_SAMPLES = 1500
LEAST_G = 0.01
"""Of the tabulated start: from nothing, G would not rise again."""
_SGD_LOW = np.array([np.log(1e-3), 0.1, 0.0, -2.0, 0.0, np.log(1e-6), 0.5, 0.0])
_SGD_HIGH = np.array([np.log(2.0), 3.0, 1.0, 2.0, 1.5, np.log(1e3), 50.0, 5.0])


def shifted_gamma(samples: Samples) -> Channel:
    """The shifted-gamma model (Bagher et al. 2012) fitted to a sample of the same objective, tabulated."""
    at = samples.geometry
    chance = samples.weights * (samples.values + samples.values.mean()) ** 2
    cumulative = np.cumsum(chance, dtype=np.float64)
    picked = np.unique(np.searchsorted(cumulative, (np.arange(SGD_SAMPLES) + 0.5) / SGD_SAMPLES * cumulative[-1]))
    picked = np.minimum(picked, len(at) - 1)
    row = np.searchsorted(at.offset, picked, side="right") - 1
    weight = np.sqrt(samples.weights[picked] / np.maximum(chance[picked], 1e-300))
    value = samples.values[picked]
    angles = [n[picked] + p[picked] for n, p in ((at.node_i, at.part_i), (at.node_o, at.part_o))]

    def residual(x: Array) -> Array:
        d, f = _sgd_d(x), _sgd_f(x)
        lobe = d[row // 90] * f[row % 90] * np.prod([_sgd_g(x, theta) for theta in angles], axis=0)
        columns = weight[:, None] * np.stack([np.ones(len(picked)), lobe / at.cosines[picked]], axis=1)
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        # The two coefficients are linear: the best of them for any shape.
        best = np.linalg.lstsq(columns / scale, weight * value, rcond=None)[0] / scale
        return columns @ np.maximum(best, 0.0) - weight * value

    descents = [
        least_squares(residual, [np.log(alpha), 0.5, 0.1, 0.0, 0.3, 0.0, 5.0, 0.5], bounds=(_SGD_LOW, _SGD_HIGH),
                      x_scale=_SGD_HIGH - _SGD_LOW, max_nfev=15)
        for alpha in (0.02, 0.2)
    ]  # fmt: skip
    best = min(descents, key=lambda f: f.cost).x
    g = _sgd_g(best, np.arange(NODES, dtype=np.float64))
    return Channel(0.0, 1.0, _sgd_d(best), _sgd_f(best), g).clamped()


def _sgd_d(x: Array) -> Array:
    alpha, p = np.exp(x[0]), x[1]
    theta = bin_centres()[0]
    shifted = alpha**2 + np.tan(theta) ** 2
    log_d = -shifted / alpha - p * np.log(shifted) - 4 * np.log(np.cos(theta))
    return np.maximum(np.exp(log_d - log_d.max()), FLOOR)


def _sgd_f(x: Array) -> Array:
    cosine = np.cos(bin_centres()[1])
    return np.maximum(x[2] - cosine * x[3] + (1 - x[2]) * (1 - cosine) ** 5, FLOOR)


def _sgd_g(x: Array, degrees: Array) -> Array:
    theta0, c, k, strength = x[4], np.exp(x[5]), x[6], x[7]
    beyond = np.maximum(np.radians(degrees) - theta0, 0.0)
    fall = np.expm1(np.minimum(c * beyond**k, 50.0))
    return np.clip(1 - strength * fall, LEAST_G, 1.0)


def starts(g_from_d: Start) -> Mapping[str, Start]:
    """The starts by name; `g_from_d` fits that model first."""
    random = {f"random-{k + 1}": _random(k) for k in range(RANDOM_STARTS)}
    return {"ones": _ones, "slices": slices, "g-from-d": g_from_d, "sgd": shifted_gamma, **random}
