"""What one evaluation of a formula costs: nothing hoisted but what depends on parameters alone."""

import time

import numpy as np

from fitters.backends.machine import run_block
from fitters.backends.program import lower_whole
from fitters.engine.projection import BLOCK
from fitters.expressions.evaluation import features
from fitters.expressions.expression import Expression

_ROUNDS = 9


def cost_ns(expression: Expression) -> float:
    """Nanoseconds per evaluation on this machine, the median of a few rounds over a block of directions.

    The formula as the register machine runs it, one thread, its features given: the work of a renderer that
    has the cosines already. A measurement: it differs from run to run.
    """
    program = lower_whole(expression)
    rng = np.random.default_rng(0)
    w = rng.normal(size=(2, BLOCK, 3))
    w[..., 2] = np.abs(w[..., 2]) + 0.1
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    inputs = program.input_vectors(features(w[0], w[1]))
    slots = program.persistent + program.temporaries - len(program.inputs)
    vectors = np.empty((max(slots, 1), BLOCK), np.float32)
    base = [inputs.ctypes.data + 4 * BLOCK * row for row in range(len(program.inputs))]
    base += [vectors.ctypes.data + 4 * BLOCK * row for row in range(slots)]
    addresses = np.array(base, np.int64)
    scalars = np.full(len(program.scalars), 0.5, np.float32)
    repeats = 200
    seconds = []
    for _ in range(_ROUNDS):
        started = time.perf_counter()
        for _ in range(repeats):
            run_block(program.code, addresses, scalars, BLOCK)
        seconds.append(time.perf_counter() - started)
    return float(np.median(seconds)) / (repeats * BLOCK) * 1e9
