"""The isotropic microfacet model in tables: eq. 1 with the height-correlated G of eq. 2."""

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


class TabulatedMicrofacet(Model):
    """P and its quantiles at `theta` (n,), G1 at `theta_k` (m,), F (k, 3) at `theta_d` (k,); angles in radians.

    The nodes are those of `isotropic.nodes` and `isotropic.area_nodes` and the centres of equal bins of theta_d;
    with `published` those of `reference`, and `evaluate` interpolates as the paper's implementation does.
    `sample` draws from the same P in both cases. `scale` is (alpha_x, alpha_y) of eq. 9.
    """

    kind = "power-iterations"

    def __init__(
        self,
        theta: Array,
        p: Array,
        theta_k: Array,
        g1: Array,
        fresnel_table: Array,
        *,
        scale: tuple[float, float] = (1.0, 1.0),
        published: bool = False,
    ):
        tables = checked(theta, p, theta_k, g1, fresnel_table, axes=1)
        self.theta, self.p, self.theta_k, self.g1, self.fresnel = tables
        self.scale, self.published = np.asarray(scale, np.float64), bool(published)
        self._area = np.maximum(np.cos(self.theta_k) / self.g1, np.cos(self.theta_k))

    @cached_property
    def _slopes(self) -> Slopes:
        inner = self.theta < QUARTER - 1e-9
        density = slopes(self.theta[inner], self.p[inner])
        # The published P is normalised by a sum; what is sampled integrates to 1.
        return slopes(self.theta[inner], self.p[inner] / density.total)

    @cached_property
    def tables(self) -> tuple[Array, ...]:
        """What `evaluate_at` reads, in its order."""
        density = self._slopes
        return density.t, density.log_p, density.rate, self.p, self._area, self.fresnel, self.scale

    @property
    def theta_d(self) -> Array:
        """Nodes (k,) of the Fresnel table."""
        count = len(self.fresnel)
        return np.linspace(0, QUARTER, count) if self.published else (np.arange(count) + 0.5) / count * QUARTER

    @property
    def slope_pdf(self) -> Array:
        """P (n,) at `theta`, of slopes before `scale`."""
        return self.p

    @property
    def ndf(self) -> Array:
        """D (n,) at `theta`, sr^-1, before `scale`; eq. 7."""
        return np.where(self.theta < QUARTER - 1e-9, self.p / np.cos(self.theta) ** 4, 0.0)

    @property
    def shadowing(self) -> Array:
        """G1 (m,) at `theta_k`, before `scale`."""
        return self.g1

    @property
    def quantiles(self) -> Array:
        """The share (n,) of slopes below each node: the levels at which the quantile function is tan(`theta`)."""
        levels = np.ones(len(self.theta))
        levels[: len(self._slopes.t) - 1] = self._slopes.level[1:]
        return levels

    def roughened(self, alpha_x: float, alpha_y: float) -> "TabulatedMicrofacet":
        """The model of the surface whose slopes are stretched by alpha_x along x and by alpha_y along y, eq. 9."""
        return TabulatedMicrofacet(
            self.theta,
            self.p,
            self.theta_k,
            self.g1,
            self.fresnel,
            scale=(self.scale[0] * alpha_x, self.scale[1] * alpha_y),
            published=self.published,
        )

    @property
    def floats(self) -> int:
        """P, Q, G1 and F; `scale` is a parameter of the renderer."""
        return 2 * len(self.theta) + len(self.g1) + self.fresnel.size

    @property
    def reciprocal(self) -> bool:
        return True

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        values = np.empty((len(w_i), 3))
        _evaluate(rows(w_i), rows(w_o), *self.tables, self.published, values)
        return values

    def scalar_code(self) -> ModelCode:
        t, log_p, rate, p, area, fresnel, scale = (table.shape for table in self.tables)
        published = self.published

        def call(w_i, w_o, tables, values):
            evaluate_at(
                vector_at(w_i),
                vector_at(w_o),
                table_at(tables, 0, t),
                table_at(tables, 1, log_p),
                table_at(tables, 2, rate),
                table_at(tables, 3, p),
                table_at(tables, 4, area),
                table_at(tables, 5, fresnel),
                table_at(tables, 6, scale),
                published,
                vector_at(values),
            )

        return ModelCode(call, self.tables)

    def sample(self, w_o: Array, u: Array) -> Array:
        density, w_i = self._slopes, np.empty((len(w_o), 3))
        _sample(rows(w_o), rows(u), density.t, density.start, density.rate, density.level, self.scale, w_i)
        return w_i

    def pdf(self, w_i: Array, w_o: Array) -> Array:
        density, values = self._slopes, np.empty(len(w_i))
        offset = 0.0 if self.published else 0.5
        per_unit = len(self.theta) - 1 + 2 * offset
        _pdf(rows(w_i), rows(w_o), density.t, density.log_p, density.rate, self.scale, per_unit, offset, values)
        return values

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            "P": self.p,
            "D": self.ndf,
            "G1": self.g1,
            "F": self.fresnel,
            "Q": self.quantiles,
            "theta": self.theta,
            "theta_k": self.theta_k,
            "theta_d": self.theta_d,
            "scale": self.scale,
            "published": np.array(self.published),
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "TabulatedMicrofacet":
        alpha_x, alpha_y = (float(alpha) for alpha in arrays["scale"])
        nodes = (arrays["theta"], arrays["P"], arrays["theta_k"], arrays["G1"], arrays["F"])
        return cls(*nodes, scale=(alpha_x, alpha_y), published=bool(arrays["published"]))


@njit(error_model="numpy")
def projected_area(cos_theta: float, area: Array, published: bool) -> float:
    """sigma at a cosine, `area` (m,) at its nodes."""
    count = area.shape[0]
    if published:
        node, share = linear(math.acos(min(cos_theta, 1.0)) / QUARTER * (count - 1), count)
    else:
        node, share = linear(math.sqrt(cos_theta) * count - 1, count)
    return max((1 - share) * area[node] + share * area[node + 1], cos_theta)


@njit(error_model="numpy")
def _slope_pdf(s: float, t: Array, log_p: Array, rate: Array, p: Array, published: bool) -> float:
    if published:
        u = math.sqrt(math.atan(math.sqrt(s)) / QUARTER)
        node, share = linear(u * (p.shape[0] - 1), p.shape[0])
        return (1 - share) * p[node] + share * p[node + 1]
    k, at = segment(s, float(p.shape[0]), 0.5, t.shape[0])
    return math.exp(log_p[k] + rate[k] * (at - t[k]))


@njit(error_model="numpy")
def evaluate_at(
    w_i: Array,
    w_o: Array,
    t: Array,
    log_p: Array,
    rate: Array,
    p: Array,
    area: Array,
    fresnel_table: Array,
    scale: Array,
    published: bool,
    values: Array,
) -> None:
    """The model at one pair of directions into values (3,); `TabulatedMicrofacet.tables` are its."""
    for channel in range(3):
        values[channel] = 0.0
    if not lit(w_i, w_o):
        return
    offset = 0.0 if published else 0.5
    cos_i, cos_o = w_i[2], w_o[2]
    x, y, z, cos_d = half_vector(w_i, w_o)
    x_slope, y_slope = x / (z * scale[0]), y / (z * scale[1])
    pdf = _slope_pdf(x_slope**2 + y_slope**2, t, log_p, rate, p, published)
    ndf = pdf / (z**4 * scale[0] * scale[1])
    _, _, z_i, length_i = stretched(w_i, scale)
    _, _, z_o, length_o = stretched(w_o, scale)
    area_i = length_i * projected_area(z_i, area, published)
    area_o = length_o * projected_area(z_o, area, published)
    # 4 cos_i cos_o / G with G1 = cos / sigma: eq. 2 without its divisions by what vanishes at grazing.
    ideal = ndf / (4 * max(area_i * cos_o + area_o * cos_i - cos_i * cos_o, 1e-300))
    if ideal < np.inf:
        times_fresnel(ideal, fresnel_table, cos_d, offset, values)


@compiled.entry(error_model="numpy")
def _evaluate(
    w_i: Array,
    w_o: Array,
    t: Array,
    log_p: Array,
    rate: Array,
    p: Array,
    area: Array,
    fresnel_table: Array,
    scale: Array,
    published: bool,
    values: Array,
) -> None:
    for n in range(w_i.shape[0]):
        evaluate_at(w_i[n], w_o[n], t, log_p, rate, p, area, fresnel_table, scale, published, values[n])


@compiled.entry(error_model="numpy")
def _sample(
    w_o: Array, u: Array, t: Array, start: Array, rate: Array, level: Array, scale: Array, w_i: Array
) -> None:
    for n in range(w_o.shape[0]):
        k = np.searchsorted(level, u[n, 0], side="right") - 1
        at = t[k] + travelled(u[n, 0] - level[k], start[k], rate[k] + 1)
        slope, azimuth = math.sqrt(math.expm1(at)), 2 * math.pi * u[n, 1]
        reflect(scale[0] * slope * math.cos(azimuth), scale[1] * slope * math.sin(azimuth), w_o[n], w_i[n])


@compiled.entry(error_model="numpy")
def _pdf(
    w_i: Array,
    w_o: Array,
    t: Array,
    log_p: Array,
    rate: Array,
    scale: Array,
    per_unit: float,
    offset: float,
    values: Array,
) -> None:
    for n in range(w_i.shape[0]):
        x, y, z, cos_d = half_vector(w_i[n], w_o[n])
        z = max(z, 1e-150)
        s = (x / (z * scale[0])) ** 2 + (y / (z * scale[1])) ** 2
        k, at = segment(s, per_unit, offset, t.shape[0])
        # D cos(theta_h) / (4 |o.h|): of h and -h, which reflect alike, the upper one was sampled.
        log_pdf = log_p[k] + rate[k] * (at - t[k]) - 3 * math.log(z)
        values[n] = math.exp(log_pdf) / (scale[0] * scale[1] * 4 * max(cos_d, 1e-12))
