"""The fitted tables as models. Bins and nodes lie as in a fit: see `fitters.models.factors.samples`."""

from typing import Any, ClassVar

import numpy as np

from fitters.errors import FittersError
from fitters.grid import SHAPE, Array
from fitters.models.directions import rows
from fitters.models.factors import lookup
from fitters.models.half_vector import HalfVectorSampling
from fitters.models.model import Model
from fitters.models.model_code import ModelCode, of_one_table, table_at, vector_at


class _Tables(HalfVectorSampling, Model):
    """Arrays under the paper's names, checked once, in the order of `shapes`."""

    shapes: ClassVar[dict[str, tuple[int, ...]]]

    def __init__(self, **arrays: Array):
        if set(arrays) != set(self.shapes):
            raise FittersError(f"{self.kind} holds {', '.join(self.shapes)}, not {', '.join(arrays)}")
        self._arrays = {name: np.ascontiguousarray(arrays[name], np.float64) for name in self.shapes}
        for name, shape in self.shapes.items():
            values = self._arrays[name]
            if values.shape != shape or not np.all((values >= 0) & np.isfinite(values)):
                raise FittersError(
                    f"{self.kind}: {name} is {shape}, finite and not negative, which {values.shape} is not"
                )

    def __getitem__(self, name: str) -> Array:
        """One of the arrays, by the paper's name for it."""
        return self._arrays[name]

    @property
    def floats(self) -> int:
        return sum(values.size for values in self._arrays.values())

    @property
    def reciprocal(self) -> bool:
        return True

    def arrays(self) -> dict[str, np.ndarray]:
        return dict(self._arrays)

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "_Tables":
        return cls(**arrays)


class MicrofacetFactors(_Tables):
    """Eq. 3 with a free G: rho_d + rho_s D(theta_h) F(theta_d) G(theta_i) G(theta_o) / (cos theta_i cos theta_o).

    rho_d, rho_s (3,) in sr^-1; D, F (90, 3) by bin and G (90, 3) at 0, 1, .. 89 degrees, largest component 1.
    """

    kind = "npf-independent-g"
    shapes: ClassVar = {"rho_d": (3,), "rho_s": (3,), "D": (90, 3), "F": (90, 3), "G": (90, 3)}

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        values = np.empty((len(w_i), 3))
        lookup.microfacet(rows(w_i), rows(w_o), *self._arrays.values(), values)
        return values

    def scalar_code(self) -> ModelCode:
        return _scalar_code(lookup.microfacet_at, tuple(self._arrays.values()))


class SmithFactors(MicrofacetFactors):
    """Eq. 3 with G from D, which need not be stored: it is here for those who evaluate."""

    kind = "npf-g-from-d"

    @property
    def floats(self) -> int:
        return super().floats - self["G"].size


class NaiveFactors(_Tables):
    """Eq. 4: rho_d + rho_s D(theta_h) F(theta_d) H(phi_d), H (180, 3)."""

    kind = "npf-naive"
    shapes: ClassVar = {"rho_d": (3,), "rho_s": (3,), "D": (90, 3), "F": (90, 3), "H": (SHAPE[2], 3)}

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        values = np.empty((len(w_i), 3))
        lookup.naive(rows(w_i), rows(w_o), *self._arrays.values(), values)
        return values

    def scalar_code(self) -> ModelCode:
        return _scalar_code(lookup.naive_at, tuple(self._arrays.values()))


class BivariateTable(_Tables):
    """Eq. 5: B(theta_h, theta_d), B (90, 90, 3) in sr^-1."""

    kind = "bivariate"
    shapes: ClassVar = {"B": (90, 90, 3)}

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        values = np.empty((len(w_i), 3))
        lookup.bivariate(rows(w_i), rows(w_o), self["B"], values)
        return values

    def scalar_code(self) -> ModelCode:
        return of_one_table(lookup.bivariate_at, self["B"])


def _scalar_code(function: Any, tables: tuple[np.ndarray, ...]) -> ModelCode:
    """Of a compiled function of two directions, rho_d, rho_s, three factors and the values."""
    rho, d, f, last = (tables[k].shape for k in (0, 2, 3, 4))

    def call(w_i, w_o, tables, values):
        function(
            vector_at(w_i),
            vector_at(w_o),
            table_at(tables, 0, rho),
            table_at(tables, 1, rho),
            table_at(tables, 2, d),
            table_at(tables, 3, f),
            table_at(tables, 4, last),
            vector_at(values),
        )

    return ModelCode(call, tables)
