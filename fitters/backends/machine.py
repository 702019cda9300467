"""The register machine: runs a program's code over a block of cells in float32, and scalar code in float64.

One loop per opcode, each over raw float32 pointers: LLVM vectorises every one of them. The dispatch costs some
nanoseconds per instruction and block, nothing per cell. Loops, opcodes and both dispatches are made from the table
`INSTRUCTIONS`; it is here and not in the table of operators because what it holds is compiled by numba.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from enum import StrEnum
from functools import cache
from typing import Any

from llvmlite import ir
from numba import carray, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from fitters import compiled
from fitters.backends import math32
from fitters.backends.math32 import FLAGS, ONE, address_as, load, store
from fitters.expressions.operators import OPERATORS, ZERO_LOG, check_complete, lacking

MAX_SLOTS = 1 << 20
"""A bound that views of raw addresses are given; nothing reads so far."""

_LOOP = {"fastmath": FLAGS, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_ENTRY = {"fastmath": FLAGS, "error_model": "numpy"}


class Operands(StrEnum):
    """What the operands of an instruction are, in order: vectors (v) or scalars (s)."""

    V = "v"
    S = "s"
    VV = "vv"
    VS = "vs"
    SV = "sv"


def _either(body: Callable) -> tuple[Callable, Callable]:
    """A body that reads the same in float32 and float64."""
    compiled_body = njit(fastmath=FLAGS, inline="always", error_model="numpy")(body)
    return compiled_body, compiled_body


_log_of_double = njit(**_ENTRY)(lambda a: math.log(a) if a != 0.0 else ZERO_LOG)
_power_of_doubles = njit(**_ENTRY)(lambda a, b: a**b)

INSTRUCTIONS = {
    "add": _either(lambda x, y: x + y),
    "sub": _either(lambda x, y: x - y),
    "mul": _either(lambda x, y: x * y),
    "div": _either(lambda x, y: x / y),
    "max": _either(lambda x, y: x if (x > y or x != x) else y),
    "min": _either(lambda x, y: x if (x < y or x != x) else y),
    "pow": (math32.power, _power_of_doubles),
    "neg": _either(lambda x: -x),
    "sin": (math32.sin, math.sin),
    "cos": (math32.cos, math.cos),
    "tan": (math32.tan, math.tan),
    "exp": (math32.exp, math.exp),
    "asin": (math32.asin, math.asin),
    "acos": (math32.acos, math.acos),
    "atan": (math32.atan, math.atan),
    "sqrt": (math.sqrt, math.sqrt),
    "log": (math32.log, _log_of_double),
}
"""By operator: its value in float32, inlined into the loops over cells, and in float64, for scalar code."""

check_complete("machine", INSTRUCTIONS)

_KINDS = {
    operator: (Operands.V,)
    if OPERATORS[operator].arity == 1
    else (Operands.VV, Operands.VS, *(() if OPERATORS[operator].commutative else (Operands.SV,)))
    for operator in INSTRUCTIONS
}

OPCODE = {
    key: number
    for number, key in enumerate(
        [("fill", Operands.S), *((operator, kinds) for operator in INSTRUCTIONS for kinds in _KINDS[operator])]
    )
}
"""Of vector code: by operator and operands; `fill` writes a scalar to every cell."""

SCALAR_OPCODE = {operator: number for number, operator in enumerate(INSTRUCTIONS)}
"""Of scalar code: by operator."""


def vector_opcode(operator: str, kinds: Operands) -> int:
    """The opcode of an operation on vectors and scalars. Raises `FittersError` for what the machine lacks."""
    if (operator, kinds) not in OPCODE:
        raise lacking("machine", [operator])
    return OPCODE[operator, kinds]


def scalar_opcode(operator: str) -> int:
    """The opcode of an operation on scalars. Raises `FittersError` for what the machine lacks."""
    if operator not in SCALAR_OPCODE:
        raise lacking("machine", [operator])
    return SCALAR_OPCODE[operator]


def _loop(kinds: Operands, body: Callable) -> Any:
    """The loop of one instruction over n cells: p and q are addresses of vectors, d that of the destination."""

    def v(p, d, n):
        for i in range(n):
            store(d, i, body(load(p, i)))

    def vv(p, q, d, n):
        for i in range(n):
            store(d, i, body(load(p, i), load(q, i)))

    def vs(p, y, d, n):
        for i in range(n):
            store(d, i, body(load(p, i), y))

    def sv(x, q, d, n):
        for i in range(n):
            store(d, i, body(x, load(q, i)))

    return njit(**_LOOP)({"v": v, "vv": vv, "vs": vs, "sv": sv}[kinds])


@njit(**_LOOP)
def _fill(x, d, n):
    for i in range(n):
        store(d, i, x)


@njit(**_LOOP)
def _divide_by_scalar(p, y, d, n):
    r = ONE / y
    for i in range(n):
        store(d, i, load(p, i) * r)


_SPECIAL = {("fill", Operands.S): _fill, ("div", Operands.VS): _divide_by_scalar}
_LOOPS = [
    (kinds, _SPECIAL.get((operator, kinds)) or _loop(kinds, INSTRUCTIONS[operator][0]))
    for operator, kinds in OPCODE
]


def _callees(typing_context: Any, functions: Sequence[tuple[Any, list[Any]]]) -> list[tuple[Any, Any]]:
    """What compiled code needs to call functions with arguments of these types."""
    kinds = [(typing_context.resolve_value_type(function), given) for function, given in functions]
    return [(kind, kind.get_call_type(typing_context, given, {})) for kind, given in kinds]


def _cases(builder: Any, opcode: Any, count: int) -> Iterator[int]:
    """A jump by opcode: what is built while a number is yielded runs for that opcode, nothing for any other."""
    end = builder.append_basic_block("end")
    switch = builder.switch(opcode, end)
    for number in range(count):
        block = builder.append_basic_block(f"opcode{number}")
        switch.add_case(ir.Constant(opcode.type, number), block)
        builder.position_at_end(block)
        yield number
        builder.branch(end)
    builder.position_at_end(end)


@intrinsic
def _run_vector(typing_context, opcode, a, b, d, slots, scalars, n):
    """Runs the loop of an opcode over n cells; `slots` and `scalars` are addresses, d that of the destination."""
    operand = {"v": types.int64, "s": types.float32}
    callees = _callees(
        typing_context,
        [(loop, [*(operand[kind] for kind in kinds), types.int64, types.int64]) for kinds, loop in _LOOPS],
    )

    def generate(context, builder, signature, arguments):
        opcode, a, b, d, slots, scalars, n = arguments
        tables = {
            "v": builder.inttoptr(slots, ir.IntType(64).as_pointer()),
            "s": builder.inttoptr(scalars, ir.FloatType().as_pointer()),
        }
        for number in _cases(builder, opcode, len(_LOOPS)):
            operands = [
                builder.load(builder.gep(tables[kind], [register]))
                for kind, register in zip(_LOOPS[number][0].value, (a, b), strict=False)
            ]
            context.get_function(*callees[number])(builder, [*operands, d, n])
        return context.get_dummy_value()

    return types.void(*[types.int32] * 3, *[types.int64] * 4), generate


@intrinsic
def _run_scalar(typing_context, opcode, a, b):
    """The value of an opcode's operator at a and b, which an operator of one operand does not read."""
    bodies = [double for _, double in INSTRUCTIONS.values()]
    arities = [OPERATORS[operator].arity for operator in INSTRUCTIONS]
    callees = _callees(
        typing_context, [(body, [types.float64] * k) for body, k in zip(bodies, arities, strict=True)]
    )

    def generate(context, builder, signature, arguments):
        opcode, *operands = arguments
        result = cgutils.alloca_once_value(builder, operands[0])
        for number in _cases(builder, opcode, len(bodies)):
            value = context.get_function(*callees[number])(builder, operands[: arities[number]])
            builder.store(value, result)
        return builder.load(result)

    return types.float64(types.int32, types.float64, types.float64), generate


def _dispatch(code_address, instructions, slots_address, scalars_address, n):
    """Runs the instructions over one block: numba compiles this, see `_kernel`."""
    code = carray(address_as(code_address, types.int32), (instructions, 4))
    slots = carray(address_as(slots_address, types.int64), (MAX_SLOTS,))
    for k in range(instructions):
        _run_vector(code[k, 0], code[k, 2], code[k, 3], slots[code[k, 1]], slots_address, scalars_address, n)


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
        registers[code[k, 1]] = _run_scalar(code[k, 0], registers[code[k, 2]], registers[code[k, 3]])
