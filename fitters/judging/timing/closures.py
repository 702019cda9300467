"""Models as compiled functions of one signature, (w_i, w_o, tables, values), called through their address.

Compiling takes some tenths of a second each; it is not kept on disk, since a formula is rarely timed twice.
"""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from llvmlite import ir
from numba import cfunc, types
from numba.extending import intrinsic

from fitters import compiled
from fitters.grid import Array
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
    """A closure that does nothing: its time is that of the loop and the call, which all others include."""

    def call(w_i, w_o, tables, values):
        pass

    return _compiled(ModelCode(call))


def _compiled(code: ModelCode) -> Closure:
    began = time.perf_counter()
    function = cfunc(SIGNATURE, error_model="numpy")(code.function)
    addresses = np.array([table.ctypes.data for table in code.tables], np.int64)
    return Closure(function, code.tables, addresses, time.perf_counter() - began)


@intrinsic
def _call(typing_context, function, w_i, w_o, tables, values):
    """Calls the C function at an address with four addresses."""

    def generate(context, builder, signature, arguments):
        integer = ir.IntType(64)
        pointer = builder.inttoptr(arguments[0], ir.FunctionType(ir.VoidType(), [integer] * 4).as_pointer())
        builder.call(pointer, arguments[1:])
        return context.get_dummy_value()

    return types.void(*[types.int64] * 5), generate


@compiled.entry(error_model="numpy")
def call_each(function: int, w_i: Array, w_o: Array, tables: int, values: Array) -> None:
    """Calls the function at an address for all directions (n, 3), one after the other.

    `values` is (n, 3), or (1, 3) to keep the last ones only.
    """
    first, step = values.ctypes.data, 24 if len(values) == len(w_i) else 0
    at_i, at_o = w_i.ctypes.data, w_o.ctypes.data
    for n in range(len(w_i)):
        _call(function, at_i + 24 * n, at_o + 24 * n, tables, first + step * n)
