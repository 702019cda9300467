"""The raw table as a model: what the measurement itself says, bin by bin."""

import numpy as np

from fitters.errors import FittersError
from fitters.grid import CELLS, SHAPE, Array, cell_index, half_diff
from fitters.materials import Material
from fitters.models.directions import both_above, rows
from fitters.models.fitted import MaterialFit
from fitters.models.fitter import Family, Fitter, MaterialFitter
from fitters.models.half_vector import HalfVectorSampling
from fitters.models.model import Model
from fitters.models.model_code import ModelCode, of_one_table


class MeasuredTable(HalfVectorSampling, Model):
    """A table (3, 90, 90, 180) in sr^-1 on the half/difference grid, read at the nearest bin as the field does."""

    kind = "measured-table"

    def __init__(self, table: Array):
        self.table = np.ascontiguousarray(table, np.float32)
        if self.table.shape != (3, *SHAPE):
            raise FittersError(f"a measured table is (3, 90, 90, 180), not {self.table.shape}")
        # NaN fails the first comparison, infinity the second.
        if not (self.table.min() >= 0 and self.table.max() < np.inf):
            raise FittersError("a measured table is finite and not negative, which this one is not")
        self._rows = self.table.reshape(3, CELLS)

    @property
    def floats(self) -> int:
        return self.table.size

    @property
    def reciprocal(self) -> bool:
        # phi_diff counts modulo pi: both orders of a pair are one cell, except for rounding on its edge.
        return True

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        w_i, w_o = rows(w_i), rows(w_o)
        above = both_above(w_i, w_o)
        values = np.zeros((len(w_i), 3))
        values[above] = self._rows[:, cell_index(*half_diff(w_i[above], w_o[above]))].T
        return values

    def scalar_code(self) -> ModelCode:
        from fitters.models.factors.lookup import measured_at

        return of_one_table(measured_at, self.table)

    def arrays(self) -> dict[str, np.ndarray]:
        return {"table": self.table}

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray]) -> "MeasuredTable":
        return cls(arrays["table"])


def _fit(material: Material) -> MaterialFit:
    return MaterialFit(MeasuredTable(material.table))


FITTERS: tuple[Fitter, ...] = (
    MaterialFitter(
        name="measured",
        family=Family("measured", "the measurement itself", "#555555"),
        model=MeasuredTable,
        fit_material=_fit,
        packages=(),
        # Its error is 0: nothing is learnt from it.
        baseline=False,
    ),
)
