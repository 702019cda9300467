"""Elementary functions on float32 as inline polynomials, so that the loops around them vectorise.

Coefficients are those of Cephes (Moshier, public domain); the largest relative error is some 3e-7. SVML would do
the same where numba is patched for it, which its wheels are not. Special values: NaN stays NaN, exp overflows to
infinity and underflows to zero, log(0) is `operators.ZERO_LOG`, log of a negative number is NaN.
"""

import math

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from fitters.expressions.operators import ZERO_LOG

FLAGS = {"nsz", "arcp", "contract", "reassoc", "afn"}
"""Never nnan or ninf: what is not finite must be seen."""

_F = np.float32
_INLINE = {"fastmath": FLAGS, "inline": "always", "error_model": "numpy"}


@intrinsic
def _round(typing_context, x):
    def generate(context, builder, signature, arguments):
        function = builder.module.declare_intrinsic(
            "llvm.rint", [ir.FloatType()], ir.FunctionType(ir.FloatType(), [ir.FloatType()])
        )
        return builder.call(function, arguments)

    return types.float32(types.float32), generate


@intrinsic
def _fma(typing_context, x, y, z):
    def generate(context, builder, signature, arguments):
        function = builder.module.declare_intrinsic(
            "llvm.fma", [ir.FloatType()], ir.FunctionType(ir.FloatType(), [ir.FloatType()] * 3)
        )
        return builder.call(function, arguments)

    return types.float32(types.float32, types.float32, types.float32), generate


@intrinsic
def _copysign(typing_context, x, y):
    def generate(context, builder, signature, arguments):
        function = builder.module.declare_intrinsic(
            "llvm.copysign", [ir.FloatType()], ir.FunctionType(ir.FloatType(), [ir.FloatType()] * 2)
        )
        return builder.call(function, arguments)

    return types.float32(types.float32, types.float32), generate


@intrinsic
def _bits(typing_context, x):
    def generate(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], ir.IntType(32))

    return types.int32(types.float32), generate


@intrinsic
def _from_bits(typing_context, x):
    def generate(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], ir.FloatType())

    return types.float32(types.int32), generate


@intrinsic
def _to_int(typing_context, x):
    def generate(context, builder, signature, arguments):
        return builder.fptosi(arguments[0], ir.IntType(32))

    return types.int32(types.float32), generate


@intrinsic
def load(typing_context, base, index):
    """The float32 at `base + 4 index`."""

    def generate(context, builder, signature, arguments):
        pointer = builder.inttoptr(arguments[0], ir.FloatType().as_pointer())
        loaded = builder.load(builder.gep(pointer, [arguments[1]], inbounds=True))
        loaded.align = 4
        return loaded

    return types.float32(types.int64, types.int64), generate


@intrinsic
def store(typing_context, base, index, value):
    """Writes the float32 `value` to `base + 4 index`."""

    def generate(context, builder, signature, arguments):
        pointer = builder.inttoptr(arguments[0], ir.FloatType().as_pointer())
        stored = builder.store(arguments[2], builder.gep(pointer, [arguments[1]], inbounds=True))
        stored.align = 4
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.float32), generate


@intrinsic
def address_as(typing_context, address, dtype):
    """An address as a pointer to values of a numba type."""
    pointer_type = types.CPointer(dtype.dtype if hasattr(dtype, "dtype") else dtype.instance_type)

    def generate(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], context.get_value_type(pointer_type))

    return pointer_type(types.int64, dtype), generate


@intrinsic
def call_kernel(typing_context, kernel, code, instructions, slots, scalars, n):
    """Calls the C function at the address `kernel` with five integers (see machine.py)."""

    def generate(context, builder, signature, arguments):
        integer = ir.IntType(64)
        function = ir.FunctionType(ir.VoidType(), [integer] * 5)
        builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return types.void(*[types.int64] * 6), generate


ZERO, HALF, ONE, TWO = _F(0), _F(0.5), _F(1), _F(2)
MINUS_HALF, MINUS_TWO = _F(-0.5), _F(-2)
NAN, INFINITY, LOG_OF_ZERO = _F(np.nan), _F(np.inf), _F(ZERO_LOG)
PI, HALF_PI = _F(math.pi), _F(math.pi / 2)

# exp: n = round(x / ln 2), remainder by a two-part ln 2, polynomial of degree 5
# Below e^-69 the result is 0: what multiplies a number near the smallest normal one runs 20 times slower.
EXP_HIGH, EXP_LOW, LOG2_E = _F(88.3762), _F(-69.0), _F(1.4426950408889634)
LN2_HIGH, LN2_LOW = _F(-0.693359375), _F(2.12194440e-4)
E0, E1, E2 = _F(1.9875691500e-4), _F(1.3981999507e-3), _F(8.3334519073e-3)
E3, E4, E5 = _F(4.1665795894e-2), _F(1.6666665459e-1), _F(5.0000001201e-1)


@njit(**_INLINE)
def exp(x):
    y = EXP_HIGH if x > EXP_HIGH else x
    y = EXP_LOW if y < EXP_LOW else y
    n = _round(y * LOG2_E)
    r = _fma(n, LN2_HIGH, y)
    r = _fma(n, LN2_LOW, r)
    p = _fma(_fma(_fma(_fma(_fma(E0, r, E1), r, E2), r, E3), r, E4), r, E5)
    z = _fma(p, r * r, r + ONE)
    z = _from_bits(np.int32(_bits(z) + (_to_int(n) << np.int32(23))))
    z = INFINITY if x > EXP_HIGH else z
    z = ZERO if x < EXP_LOW else z
    return z if x == x else NAN


# log: mantissa in [sqrt(1/2), sqrt(2)), polynomial of degree 8
ROOT_HALF_BITS = np.int32(0x3F3504F3)
MANTISSA = np.int32(0x007FFFFF)
L0, L1, L2 = _F(7.0376836292e-2), _F(-1.1514610310e-1), _F(1.1676998740e-1)
L3, L4, L5 = _F(-1.2420140846e-1), _F(1.4249322787e-1), _F(-1.6668057665e-1)
L6, L7, L8 = _F(2.0000714765e-1), _F(-2.4999993993e-1), _F(3.3333331174e-1)
LOG_LOW, LOG_HIGH = _F(-2.12194440e-4), _F(0.693359375)


@njit(**_INLINE)
def log(x):
    bits = np.int32(_bits(x) - ROOT_HALF_BITS)
    n = _F(np.int32(bits >> np.int32(23)))
    f = _from_bits(np.int32((bits & MANTISSA) + ROOT_HALF_BITS)) - ONE
    z = f * f
    p = _fma(_fma(_fma(_fma(L0, f, L1), f, L2), f, L3), f, L4)
    p = _fma(_fma(_fma(_fma(p, f, L5), f, L6), f, L7), f, L8)
    y = f * z * p
    y = _fma(n, LOG_LOW, y)
    y = _fma(z, MINUS_HALF, y)
    y = f + y
    y = _fma(n, LOG_HIGH, y)
    y = INFINITY if x == INFINITY else y
    y = LOG_OF_ZERO if x == ZERO else y
    return y if x >= ZERO else NAN


@njit(**_INLINE)
def power(a, b):
    """a^b; a negative base takes whole exponents only, as in NumPy."""
    y = exp(b * log(abs(a)))
    y = ONE if b == ZERO else y
    whole = _round(b) == b
    odd = _round(b * HALF) * TWO != b
    negative = (-y if odd else y) if whole else NAN
    return negative if a < ZERO else y


# sin, cos: quadrant by a three-part pi / 2
TWO_OVER_PI = _F(2 / math.pi)
Q0, Q1, Q2 = _F(-1.5703125), _F(-4.837512969970703125e-4), _F(-7.54978995489188e-8)
S0, S1, S2 = _F(-1.9515295891e-4), _F(8.3321608736e-3), _F(-1.6666654611e-1)
C0, C1, C2 = _F(2.443315711809948e-5), _F(-1.388731625493765e-3), _F(4.166664568298827e-2)
LARGEST_ANGLE = _F(1e5)


@njit(**_INLINE)
def _sine(x, quadrant):
    """sin(x + quadrant pi / 2); NaN beyond 1e5, where float32 has no angle left."""
    n = _round(x * TWO_OVER_PI)
    r = _fma(n, Q0, x)
    r = _fma(n, Q1, r)
    r = _fma(n, Q2, r)
    inside = abs(x) < LARGEST_ANGLE
    turn = np.int32(_to_int(n if inside else ZERO) + quadrant)
    z = r * r
    s = _fma(_fma(_fma(S0, z, S1), z, S2) * z, r, r)
    c = _fma(_fma(_fma(C0, z, C1), z, C2), z * z, _fma(z, MINUS_HALF, ONE))
    y = c if (turn & np.int32(1)) != np.int32(0) else s
    y = _from_bits(np.int32(_bits(y) ^ ((turn & np.int32(2)) << np.int32(30))))
    return y if inside else NAN


@njit(**_INLINE)
def sin(x):
    return _sine(x, np.int32(0))


@njit(**_INLINE)
def cos(x):
    return _sine(x, np.int32(1))


@njit(**_INLINE)
def tan(x):
    return _sine(x, np.int32(0)) / _sine(x, np.int32(1))


A0, A1, A2 = _F(4.2163199048e-2), _F(2.4181311049e-2), _F(4.5470025998e-2)
A3, A4 = _F(7.4953002686e-2), _F(1.6666752422e-1)


@njit(**_INLINE)
def _asin_core(x):
    """asin(x) for x in [0, 1/2]; asin(sqrt((1 - x) / 2)) above."""
    big = x > HALF
    half = _fma(x, MINUS_HALF, HALF)
    z = half if big else x * x
    s = _F(math.sqrt(half)) if big else x
    return _fma(_fma(_fma(_fma(_fma(A0, z, A1), z, A2), z, A3), z, A4) * z, s, s)


@njit(**_INLINE)
def asin(x):
    y = _asin_core(abs(x))
    return _copysign(_fma(y, MINUS_TWO, HALF_PI) if abs(x) > HALF else y, x)


@njit(**_INLINE)
def acos(x):
    y = _asin_core(abs(x))
    twice = y + y
    return (PI - twice if x < ZERO else twice) if abs(x) > HALF else HALF_PI - _copysign(y, x)


T0, T1, T2, T3 = _F(0.00282363896), _F(-0.01595690287), _F(0.04250498861), _F(-0.07489009201)
T4, T5, T6, T7 = _F(0.10634793341), _F(-0.14202736318), _F(0.19992695748), _F(-0.33333101863)


@njit(**_INLINE)
def atan(x):
    a = abs(x)
    big = a > ONE
    t = ONE / a if big else a
    z = t * t
    p = _fma(_fma(_fma(_fma(T0, z, T1), z, T2), z, T3), z, T4)
    p = _fma(_fma(_fma(p, z, T5), z, T6), z, T7)
    y = _fma(p * z, t, t)
    return _copysign(HALF_PI - y if big else y, x)
