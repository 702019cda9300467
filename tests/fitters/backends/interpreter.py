"""Lowered forms in float64 and programs on the register machine, run plainly, for the tests to compare."""

import numpy as np

from fitters.backends.machine import run_block, run_scalars
from fitters.backends.program import Program
from fitters.expressions.evaluation import Evaluator, evaluate_features
from fitters.expressions.operators import OPERATORS


def interpret(form, roots, parameters, seen):
    """Values (n,) of the roots of a lowered form, in float64."""
    return [np.broadcast_to(row, np.shape(seen["wi.z"])) for row in Evaluator(form, roots).run(parameters, seen)]


def perturbed(tree, parameters, seen, rng, size=1e-12):
    """Plain values of a tree with every operation's result off by a random relative `size`.

    How far these stray from the exact ones is the condition of the tree at those values: no arrangement of
    the same sums and products can be expected to be closer than that, relative to the rounding it makes.
    """
    if not tree.children or tree.symbol == "dot":
        return evaluate_features(tree, parameters, seen)
    children = [perturbed(child, parameters, seen, rng, size) for child in tree.children]
    with np.errstate(all="ignore"):
        result = OPERATORS[tree.symbol].meaning(*children)
    return result * (1 + size * rng.uniform(-1, 1, np.shape(result)))


def run(program: Program, parameters, seen, block=1024):
    """The machine's outputs: a list of float32 (n,), the offset (zeros where there is none) first."""
    n = len(seen["wi.z"])
    inputs = program.input_vectors(seen)
    written = np.full((max(program.persistent - len(program.inputs), 1), n), np.nan, np.float32)
    scratch = np.full((max(program.temporaries, 1), block), np.nan, np.float32)
    registers = program.scalars.copy()
    registers[: len(program.searched)] = [parameters[name] for name in program.searched]
    run_scalars(program.scalar_code, registers)
    with np.errstate(all="ignore"):
        scalars = registers.astype(np.float32)
    rows = [*inputs[: len(program.inputs)], *written[: program.persistent - len(program.inputs)]]
    for start in range(0, n, block):
        slots = [row[start:].ctypes.data for row in rows] + [row.ctypes.data for row in scratch]
        run_block(program.code, np.array(slots, np.int64), scalars, min(block, n - start))
    zeros = np.zeros(n, np.float32)
    return [rows[slot] if slot >= 0 else zeros for slot in program.outputs]


def combined(program: Program, parameters, seen):
    """f (n,) in float64 from the machine's outputs and the linear parameters."""
    offset, *coefficients = (output.astype(np.float64) for output in run(program, parameters, seen))
    with np.errstate(all="ignore"):
        for name, coefficient in zip(program.linear, coefficients, strict=True):
            offset = offset + np.float32(parameters[name]) * coefficient
    return offset
