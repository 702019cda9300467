"""The one loop that calls every model, direction after direction, through a pointer."""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from fitters import compiled
from fitters.grid import Array


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
    """Calls `function`, an address, at directions (n, 3); `values` is (n, 3), or (1, 3) to keep the last only."""
    first, step = values.ctypes.data, 24 if len(values) == len(w_i) else 0
    at_i, at_o = w_i.ctypes.data, w_o.ctypes.data
    for n in range(len(w_i)):
        _call(function, at_i + 24 * n, at_o + 24 * n, tables, first + step * n)
