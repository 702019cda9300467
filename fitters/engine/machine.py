"""The register machine: runs a program's code over a block of cells.

One loop per opcode, each over raw float32 pointers: LLVM vectorises every one of them. The dispatch costs some
nanoseconds per instruction and block, nothing per cell. Opcode numbers are those of `opcodes.py`, which a test
compares with this file by running every one.
"""

import math
from functools import cache

from numba import carray, njit, types

from fitters import compiled
from fitters.engine import math32
from fitters.engine.graph import ZERO_LOG
from fitters.engine.math32 import FLAGS, ONE, address_as, load, store

MAX_SLOTS = 1 << 20
"""A bound that views of raw addresses are given; nothing reads so far."""

_LOOP = {"fastmath": FLAGS, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_ENTRY = {"fastmath": FLAGS, "error_model": "numpy"}


@njit(**_LOOP)
def _fill_s(x, d, n):
    for i in range(n):
        store(d, i, x)


@njit(**_LOOP)
def _add_vv(p, q, d, n):
    for i in range(n):
        x = load(p, i)
        y = load(q, i)
        store(d, i, x + y)


@njit(**_LOOP)
def _add_vs(p, y, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, x + y)


@njit(**_LOOP)
def _sub_vv(p, q, d, n):
    for i in range(n):
        x = load(p, i)
        y = load(q, i)
        store(d, i, x - y)


@njit(**_LOOP)
def _sub_vs(p, y, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, x - y)


@njit(**_LOOP)
def _sub_sv(x, q, d, n):
    for i in range(n):
        y = load(q, i)
        store(d, i, x - y)


@njit(**_LOOP)
def _mul_vv(p, q, d, n):
    for i in range(n):
        x = load(p, i)
        y = load(q, i)
        store(d, i, x * y)


@njit(**_LOOP)
def _mul_vs(p, y, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, x * y)


@njit(**_LOOP)
def _div_vv(p, q, d, n):
    for i in range(n):
        x = load(p, i)
        y = load(q, i)
        store(d, i, x / y)


@njit(**_LOOP)
def _div_vs(p, y, d, n):
    r = ONE / y
    for i in range(n):
        store(d, i, load(p, i) * r)


@njit(**_LOOP)
def _div_sv(x, q, d, n):
    for i in range(n):
        y = load(q, i)
        store(d, i, x / y)


@njit(**_LOOP)
def _max_vv(p, q, d, n):
    for i in range(n):
        x = load(p, i)
        y = load(q, i)
        store(d, i, x if (x > y or x != x) else y)


@njit(**_LOOP)
def _max_vs(p, y, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, x if (x > y or x != x) else y)


@njit(**_LOOP)
def _min_vv(p, q, d, n):
    for i in range(n):
        x = load(p, i)
        y = load(q, i)
        store(d, i, x if (x < y or x != x) else y)


@njit(**_LOOP)
def _min_vs(p, y, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, x if (x < y or x != x) else y)


@njit(**_LOOP)
def _pow_vv(p, q, d, n):
    for i in range(n):
        x = load(p, i)
        y = load(q, i)
        store(d, i, math32.power(x, y))


@njit(**_LOOP)
def _pow_vs(p, y, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, math32.power(x, y))


@njit(**_LOOP)
def _pow_sv(x, q, d, n):
    for i in range(n):
        y = load(q, i)
        store(d, i, math32.power(x, y))


@njit(**_LOOP)
def _neg_v(p, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, -x)


@njit(**_LOOP)
def _sin_v(p, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, math32.sin(x))


@njit(**_LOOP)
def _cos_v(p, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, math32.cos(x))


@njit(**_LOOP)
def _tan_v(p, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, math32.tan(x))


@njit(**_LOOP)
def _exp_v(p, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, math32.exp(x))


@njit(**_LOOP)
def _asin_v(p, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, math32.asin(x))


@njit(**_LOOP)
def _acos_v(p, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, math32.acos(x))


@njit(**_LOOP)
def _atan_v(p, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, math32.atan(x))


@njit(**_LOOP)
def _sqrt_v(p, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, math.sqrt(x))


@njit(**_LOOP)
def _log_v(p, d, n):
    for i in range(n):
        x = load(p, i)
        store(d, i, math32.log(x))


def _dispatch(code_address, instructions, slots_address, scalars_address, n):
    """Runs the instructions over one block: numba compiles this, see `_kernel`."""
    code = carray(address_as(code_address, types.int32), (instructions, 4))
    slots = carray(address_as(slots_address, types.int64), (MAX_SLOTS,))
    scalars = carray(address_as(scalars_address, types.float32), (MAX_SLOTS,))
    for k in range(instructions):
        opcode = code[k, 0]
        d = slots[code[k, 1]]
        a = code[k, 2]
        b = code[k, 3]
        if opcode == 0:
            _fill_s(scalars[a], d, n)
        elif opcode == 1:
            _add_vv(slots[a], slots[b], d, n)
        elif opcode == 2:
            _add_vs(slots[a], scalars[b], d, n)
        elif opcode == 3:
            _sub_vv(slots[a], slots[b], d, n)
        elif opcode == 4:
            _sub_vs(slots[a], scalars[b], d, n)
        elif opcode == 5:
            _sub_sv(scalars[a], slots[b], d, n)
        elif opcode == 6:
            _mul_vv(slots[a], slots[b], d, n)
        elif opcode == 7:
            _mul_vs(slots[a], scalars[b], d, n)
        elif opcode == 8:
            _div_vv(slots[a], slots[b], d, n)
        elif opcode == 9:
            _div_vs(slots[a], scalars[b], d, n)
        elif opcode == 10:
            _div_sv(scalars[a], slots[b], d, n)
        elif opcode == 11:
            _max_vv(slots[a], slots[b], d, n)
        elif opcode == 12:
            _max_vs(slots[a], scalars[b], d, n)
        elif opcode == 13:
            _min_vv(slots[a], slots[b], d, n)
        elif opcode == 14:
            _min_vs(slots[a], scalars[b], d, n)
        elif opcode == 15:
            _pow_vv(slots[a], slots[b], d, n)
        elif opcode == 16:
            _pow_vs(slots[a], scalars[b], d, n)
        elif opcode == 17:
            _pow_sv(scalars[a], slots[b], d, n)
        elif opcode == 18:
            _neg_v(slots[a], d, n)
        elif opcode == 19:
            _sin_v(slots[a], d, n)
        elif opcode == 20:
            _cos_v(slots[a], d, n)
        elif opcode == 21:
            _tan_v(slots[a], d, n)
        elif opcode == 22:
            _exp_v(slots[a], d, n)
        elif opcode == 23:
            _asin_v(slots[a], d, n)
        elif opcode == 24:
            _acos_v(slots[a], d, n)
        elif opcode == 25:
            _atan_v(slots[a], d, n)
        elif opcode == 26:
            _sqrt_v(slots[a], d, n)
        elif opcode == 27:
            _log_v(slots[a], d, n)


@cache
def _kernel():
    """The dispatch, compiled at the first call of this.

    A C function, called by its address: what calls it cannot inline it, which would make LLVM optimise all the
    loops again in every caller (a minute instead of seconds).
    """
    return compiled.c_function(types.void(*[types.int64] * 5), **_ENTRY)(_dispatch)


def kernel_address() -> int:
    """Where the compiled dispatch lies in this process: `math32.call_kernel` calls it from compiled code."""
    return _kernel().address


def run_block(code, slots, scalars, n):
    """Runs `code` (instructions, 4) over n cells; slots[s] is the address of vector s, scalars are float32."""
    _kernel().ctypes(code.ctypes.data, len(code), slots.ctypes.data, scalars.ctypes.data, n)


@compiled.entry(**_ENTRY)
def run_scalars(code, registers):
    """Runs `code` (instructions, 4) over the float64 scalar registers."""
    for k in range(code.shape[0]):
        opcode = code[k, 0]
        d = code[k, 1]
        a = registers[code[k, 2]]
        b = registers[code[k, 3]]
        if opcode == 1:
            registers[d] = a + b
        elif opcode == 2:
            registers[d] = a - b
        elif opcode == 3:
            registers[d] = a * b
        elif opcode == 4:
            registers[d] = a / b
        elif opcode == 5:
            registers[d] = a if (a > b or a != a) else b
        elif opcode == 6:
            registers[d] = a if (a < b or a != a) else b
        elif opcode == 7:
            registers[d] = a**b
        elif opcode == 8:
            registers[d] = -a
        elif opcode == 9:
            registers[d] = math.sin(a)
        elif opcode == 10:
            registers[d] = math.cos(a)
        elif opcode == 11:
            registers[d] = math.tan(a)
        elif opcode == 12:
            registers[d] = math.exp(a)
        elif opcode == 13:
            registers[d] = math.asin(a)
        elif opcode == 14:
            registers[d] = math.acos(a)
        elif opcode == 15:
            registers[d] = math.atan(a)
        elif opcode == 16:
            registers[d] = math.sqrt(a)
        elif opcode == 17:
            registers[d] = math.log(a) if a != 0.0 else ZERO_LOG
