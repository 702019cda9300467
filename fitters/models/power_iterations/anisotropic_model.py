"""The anisotropic microfacet model in tables: P and G1 over (phi, theta).

The polar form of appendix A: a slope's azimuth takes the part of its x, its elevation the part of its y.
Between two columns P is linear in phi, so that a slope has the elevation of one column and a triangular azimuth
around it.
"""

import math
from functools import cached_property

import numpy as np
from numba import njit

from fitters import compiled
from fitters.grid import Array
from fitters.models.directions import rows
from fitters.models.model import Model
from fitters.models.model_code import ModelCode, table_at, vector_at
from fitters.models.power_iterations.lookups import (
    QUARTER,
    half_vector,
    linear,
    lit,
    reflect,
    segment,
    stretched,
    times_fresnel,
)
from fitters.models.power_iterations.slopes import Slopes, slopes, travelled
from fitters.models.power_iterations.tables import checked


class AnisotropicMicrofacet(Model):
    """P and its quantiles (a, n) at azimuths 2 pi i / a and `theta` (n,), G1 (a, m) at `theta_k` (m,), F (k, 3).

    Nodes as in `TabulatedMicrofacet`. phi is the azimuth of the normal, whose slopes point the other way (eq. 5).
    `scale` is (alpha_x, alpha_y) of eq. 9.
    """

    kind = "power-iterations-anisotropic"

    def __init__(
        self,
        theta: Array,
        p: Array,
        theta_k: Array,
        g1: Array,
        fresnel_table: Array,
        *,
        scale: tuple[float, float] = (1.0, 1.0),
    ):
        tables = checked(theta, p, theta_k, g1, fresnel_table, axes=2)
        self.theta, self.p, self.theta_k, self.g1, self.fresnel = tables
        self.scale = np.asarray(scale, np.float64)
        self._area = np.maximum(np.cos(self.theta_k) / self.g1, np.cos(self.theta_k))

    @cached_property
    def _slopes(self) -> Slopes:
        density = slopes(self.theta, self.p)
        return slopes(self.theta, self.p / density.total.mean())

    @cached_property
    def _columns(self) -> Array:
        """Q1: the share (a + 1,) of slopes in the columns before each."""
        share = np.concatenate([[0.0], np.cumsum(self._slopes.total)])
        return share / share[-1]

    @cached_property
    def tables(self) -> tuple[Array, ...]:
        """What `evaluate_at` reads, in its order."""
        density = self._slopes
        return density.t, density.log_p, density.rate, self._area, self.fresnel, self.scale

    @property
    def theta_d(self) -> Array:
        """Nodes (k,) of the Fresnel table."""
        return (np.arange(len(self.fresnel)) + 0.5) / len(self.fresnel) * QUARTER

    @property
    def slope_pdf(self) -> Array:
        """P (a, n), of slopes before `scale`."""
        return self.p

    @property
    def ndf(self) -> Array:
        """D (a, n), sr^-1, before `scale`; eq. 7."""
        return self.p / np.cos(self.theta) ** 4

    @property
    def shadowing(self) -> Array:
        """G1 (a, m) at `theta_k`, before `scale`."""
        return self.g1

    @property
    def quantiles(self) -> Array:
        """Q2: the share (a, n) of a column's slopes below each node."""
        return self._slopes.level[:, 1:] / self._slopes.total[:, None]

    def roughened(self, alpha_x: float, alpha_y: float) -> "AnisotropicMicrofacet":
        """The model of the surface whose slopes are stretched by alpha_x along x and by alpha_y along y, eq. 9."""
        scale = (self.scale[0] * alpha_x, self.scale[1] * alpha_y)
        return AnisotropicMicrofacet(self.theta, self.p, self.theta_k, self.g1, self.fresnel, scale=scale)

    @property
    def floats(self) -> int:
        """P, both quantile tables, G1 and F; `scale` is a parameter of the renderer."""
        return 2 * self.p.size + len(self.p) + self.g1.size + self.fresnel.size

    @property
    def reciprocal(self) -> bool:
        return True

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        values = np.empty((len(w_i), 3))
        _evaluate(rows(w_i), rows(w_o), *self.tables, values)
        return values

    def scalar_code(self) -> ModelCode:
        t, log_p, rate, area, fresnel, scale = (table.shape for table in self.tables)

        def call(w_i, w_o, tables, values):
            evaluate_at(
                vector_at(w_i),
                vector_at(w_o),
                table_at(tables, 0, t),
                table_at(tables, 1, log_p),
                table_at(tables, 2, rate),
                table_at(tables, 3, area),
                table_at(tables, 4, fresnel),
                table_at(tables, 5, scale),
                vector_at(values),
            )

        return ModelCode(call, self.tables)

    def sample(self, w_o: Array, u: Array) -> Array:
        density, w_i = self._slopes, np.empty((len(w_o), 3))
        tables = (density.t, density.start, density.rate, density.level, density.total)
        _sample(rows(w_o), rows(u), *tables, self._columns, self.scale, w_i)
        return w_i

    def pdf(self, w_i: Array, w_o: Array) -> Array:
        density, values = self._slopes, np.empty(len(w_i))
        _pdf(rows(w_i), rows(w_o), density.t, density.log_p, density.rate, self.scale, values)
        return values

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            "P": self.p,
            "D": self.ndf,
            "G1": self.g1,
            "F": self.fresnel,
            "Q1": self._columns[:-1],
            "Q2": self.quantiles,
            "theta": self.theta,
            "theta_k": self.theta_k,
            "theta_d": self.theta_d,
            "phi": np.arange(len(self.p)) / len(self.p) * 2 * np.pi,
            "scale": self.scale,
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "AnisotropicMicrofacet":
        alpha_x, alpha_y = (float(alpha) for alpha in arrays["scale"])
        nodes = (arrays["theta"], arrays["P"], arrays["theta_k"], arrays["G1"], arrays["F"])
        return cls(*nodes, scale=(alpha_x, alpha_y))


@njit(error_model="numpy")
def _azimuth(x: float, y: float, count: int) -> tuple[int, int, float]:
    """The columns around an azimuth, and the share of the second."""
    position = math.atan2(y, x) / (2 * math.pi) * count
    if position < 0.0:
        position += count
    before = int(position)
    return before % count, (before + 1) % count, position - before


@njit(error_model="numpy")
def _area_at(x: float, y: float, z: float, area: Array) -> float:
    """sigma in a unit direction, `area` (a, m)."""
    columns, count = area.shape
    a, b, right = _azimuth(x, y, columns)
    node, up = linear(math.sqrt(z) * count - 1, count)
    at_a = (1 - up) * area[a, node] + up * area[a, node + 1]
    at_b = (1 - up) * area[b, node] + up * area[b, node + 1]
    return max((1 - right) * at_a + right * at_b, z)


@njit(error_model="numpy")
def _slope_measure(
    x: float, y: float, z: float, t: Array, log_p: Array, rate: Array, scale: Array, power: int
) -> float:
    """P / (alpha_x alpha_y) / z^power at the slope of a unit normal."""
    z = max(z, 1e-150)
    x, y = x / (z * scale[0]), y / (z * scale[1])
    a, b, right = _azimuth(x, y, log_p.shape[0])
    count = t.shape[0]
    k, at = segment(x * x + y * y, count - 1.0, 0.5, count)
    log_scale = power * math.log(z)
    at_a = math.exp(log_p[a, k] + rate[a, k] * (at - t[k]) - log_scale)
    at_b = math.exp(log_p[b, k] + rate[b, k] * (at - t[k]) - log_scale)
    return ((1 - right) * at_a + right * at_b) / (scale[0] * scale[1])


@njit(error_model="numpy")
def evaluate_at(
    w_i: Array,
    w_o: Array,
    t: Array,
    log_p: Array,
    rate: Array,
    area: Array,
    fresnel_table: Array,
    scale: Array,
    values: Array,
) -> None:
    """The model at one pair of directions into values (3,); `AnisotropicMicrofacet.tables` are its."""
    for channel in range(3):
        values[channel] = 0.0
    if not lit(w_i, w_o):
        return
    cos_i, cos_o = w_i[2], w_o[2]
    x, y, z, cos_d = half_vector(w_i, w_o)
    ndf = _slope_measure(x, y, z, t, log_p, rate, scale, 4)
    x_i, y_i, z_i, length_i = stretched(w_i, scale)
    x_o, y_o, z_o, length_o = stretched(w_o, scale)
    area_i = length_i * _area_at(x_i, y_i, z_i, area)
    area_o = length_o * _area_at(x_o, y_o, z_o, area)
    ideal = ndf / (4 * max(area_i * cos_o + area_o * cos_i - cos_i * cos_o, 1e-300))
    if ideal < np.inf:
        times_fresnel(ideal, fresnel_table, cos_d, 0.5, values)


@compiled.entry(error_model="numpy")
def _evaluate(
    w_i: Array,
    w_o: Array,
    t: Array,
    log_p: Array,
    rate: Array,
    area: Array,
    fresnel_table: Array,
    scale: Array,
    values: Array,
) -> None:
    for n in range(w_i.shape[0]):
        evaluate_at(w_i[n], w_o[n], t, log_p, rate, area, fresnel_table, scale, values[n])


@compiled.entry(error_model="numpy")
def _sample(
    w_o: Array,
    u: Array,
    t: Array,
    start: Array,
    rate: Array,
    level: Array,
    total: Array,
    columns: Array,
    scale: Array,
    w_i: Array,
) -> None:
    count = total.shape[0]
    for n in range(w_o.shape[0]):
        column = min(np.searchsorted(columns, u[n, 2], side="right") - 1, count - 1)
        mass = u[n, 0] * total[column]
        k = np.searchsorted(level[column], mass, side="right") - 1
        at = t[k] + travelled(mass - level[column, k], start[column, k], rate[column, k] + 1)
        v = 2 * u[n, 1] - 1
        aside = 1 - math.sqrt(1 - abs(v))
        azimuth = (column + (aside if v > 0 else -aside)) / count * 2 * math.pi
        slope = -math.sqrt(math.expm1(at))
        reflect(scale[0] * slope * math.cos(azimuth), scale[1] * slope * math.sin(azimuth), w_o[n], w_i[n])


@compiled.entry(error_model="numpy")
def _pdf(w_i: Array, w_o: Array, t: Array, log_p: Array, rate: Array, scale: Array, values: Array) -> None:
    for n in range(w_i.shape[0]):
        x, y, z, cos_d = half_vector(w_i[n], w_o[n])
        values[n] = _slope_measure(x, y, z, t, log_p, rate, scale, 3) / (4 * max(cos_d, 1e-12))
