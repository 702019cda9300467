"""Models as compiled functions of one signature, (w_i, w_o, tables, values), called through their address.

Compiled in memory, some tenths of a second each: no caller asks for the same formula twice.
"""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import cfunc, types

from fitters.grid import Array
from fitters.judging.timing.loop import call_each
from fitters.models.directions import rows
from fitters.models.model import Model
from fitters.models.model_code import ModelCode

SIGNATURE = types.void(types.int64, types.int64, types.int64, types.int64)
"""Addresses of w_i (3,), w_o (3,), of the addresses of the tables, and of values (3,)."""


@dataclass(frozen=True, eq=False)
class Closure:
    """A model ready to be called: the compiled function, the tables that it reads, and how long compiling took."""

    function: Any
    tables: tuple[np.ndarray, ...]
    addresses: np.ndarray
    compile_seconds: float

    @property
    def address(self) -> int:
        return self.function.address

    def evaluate(self, w_i: Array, w_o: Array) -> Array:
        """Values (n, 3) at directions (n, 3), one call for each: those of the model's own `evaluate`."""
        values = np.empty((len(w_i), 3))
        call_each(self.address, rows(w_i), rows(w_o), self.addresses.ctypes.data, values)
        return values


def closure(model: Model) -> Closure:
    """A model, compiled. Raises `FittersError` for a kind that has no code for one pair of directions."""
    return _compiled(model.scalar_code())


def empty() -> Closure:
    """What does nothing: its time is that of the loop and the call, which every other's holds too."""

    def call(w_i, w_o, tables, values):
        pass

    return _compiled(ModelCode(call))


def _compiled(code: ModelCode) -> Closure:
    began = time.perf_counter()
    function = cfunc(SIGNATURE, error_model="numpy")(code.function)
    addresses = np.array([table.ctypes.data for table in code.tables], np.int64)
    return Closure(function, code.tables, addresses, time.perf_counter() - began)
