"""What a simplex minimises: the sum of squares of one target at given values of the searched parameters.

Coordinates: a parameter with a positive lower bound is searched in its logarithm, any other as it is; a step out
of the box is clipped to it. The objective is the sum of squares of `projection.py`, infinite where not finite.
"""

import numpy as np
from numba import carray, njit, types

from fitters.backends.machine import run_scalars
from fitters.backends.math32 import address_as, call_kernel
from fitters.engine.projection import BLOCK, normal_equations, solve_box, sum_of_squares

_INNER = {"error_model": "numpy"}

MACHINE = np.dtype(
    [
        ("kernel", np.int64),  # address of the compiled dispatch, `machine.kernel_address()`
        ("code", np.int64),  # int32 (instructions, 4)
        ("instructions", np.int64),
        ("scalar_code", np.int64),  # int32 (scalar_instructions, 4)
        ("scalar_instructions", np.int64),
        ("registers", np.int64),  # float64 (registers_count,), the searched parameters first
        ("scalars", np.int64),  # float32 copy that vector code reads
        ("registers_count", np.int64),
        ("base", np.int64),  # int64 (slots_count,) addresses of the vectors
        ("advance", np.int64),  # int64 (slots_count,) bytes per cell: 4, or 0 for temporaries
        ("slots", np.int64),  # int64 (slots_count,) addresses at the current block
        ("slots_count", np.int64),
        ("outputs", np.int64),  # int64 (1 + linear,) addresses of the outputs, 0 for no offset
        ("searched", np.int64),  # how many parameters a simplex varies
        ("linear", np.int64),  # how many are solved in closed form
        ("logarithmic", np.int64),  # float64 (searched,), 1 where the coordinate is a logarithm
        ("box", np.int64),  # float64 (2, searched), lower and upper bounds in coordinates
        ("linear_box", np.int64),  # float64 (2, linear)
        ("normal", np.int64),  # float64 (linear + 1, linear): Gram matrix, then right side
        ("scratch", np.int64),  # float32 (BLOCK,)
        ("weights", np.int64),  # int64 (targets,) addresses of float32 (cells,)
        ("weighted", np.int64),  # int64 (targets,) addresses of weights times measured values
        ("cells", np.int64),
    ],
    align=True,
)
"""Everything that one expression on one set of cells needs: counts, and addresses of arrays.

One record is one argument. As a tuple of arrays it was some hundred, at every call, which cost most of a minute
to compile.
"""


@njit(**_INNER)
def reals(address, *shape):
    return carray(address_as(address, types.float64), shape)


@njit(**_INNER)
def integers(address, count):
    return carray(address_as(address, types.int64), (count,))


@njit(**_INNER)
def compute(machine, x):
    """Runs the program at coordinates x (searched,); the outputs then hold offset and coefficients."""
    registers = reals(machine.registers, machine.registers_count)
    logarithmic = reals(machine.logarithmic, machine.searched)
    for i in range(x.shape[0]):
        registers[i] = np.exp(x[i]) if logarithmic[i] > 0.0 else x[i]
    run_scalars(carray(address_as(machine.scalar_code, types.int32), (machine.scalar_instructions, 4)), registers)
    scalars = carray(address_as(machine.scalars, types.float32), (machine.registers_count,))
    for i in range(machine.registers_count):
        scalars[i] = registers[i]
    base, advance = integers(machine.base, machine.slots_count), integers(machine.advance, machine.slots_count)
    slots = integers(machine.slots, machine.slots_count)
    for b in range(0, machine.cells, BLOCK):
        for s in range(machine.slots_count):
            slots[s] = base[s] + advance[s] * b
        n = min(BLOCK, machine.cells - b)
        call_kernel(machine.kernel, machine.code, machine.instructions, machine.slots, machine.scalars, n)


@njit(**_INNER)
def project(machine, target, c):
    """The best linear coefficients c (linear,) for the outputs as they stand, and their sum of squares."""
    k = c.shape[0]
    w = integers(machine.weights, target + 1)[target]
    wy = integers(machine.weighted, target + 1)[target]
    outputs = integers(machine.outputs, k + 1)
    if k > 0:
        normal, box = reals(machine.normal, k + 1, k), reals(machine.linear_box, 2, k)
        normal_equations(outputs, w, wy, machine.cells, normal[:k], normal[k])
        if not solve_box(normal[:k], normal[k], box[0], box[1], c):
            return np.inf
    scratch = carray(address_as(machine.scratch, types.float32), (BLOCK,))
    value = sum_of_squares(outputs, c, w, wy, machine.cells, scratch)
    return value if np.isfinite(value) else np.inf


@njit(**_INNER)
def objective(machine, target, x, c):
    """The sum of squares of a target at coordinates x, which are clipped into the box in place."""
    box = reals(machine.box, 2, machine.searched)
    for i in range(x.shape[0]):
        x[i] = min(max(x[i], box[0, i]), box[1, i])
    compute(machine, x)
    return project(machine, target, c)
