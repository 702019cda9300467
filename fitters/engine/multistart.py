"""Many descents for all targets of one expression: from a table of starts, then from other targets' optima."""

from collections import namedtuple

import numpy as np
from numba import njit

from fitters import compiled
from fitters.backends.math32 import load
from fitters.engine.objective import compute, integers, objective, project
from fitters.engine.projection import BLOCK, combine
from fitters.engine.simplex import copy, nelder_mead

_INNER = {"error_model": "numpy"}

Descent = namedtuple("Descent", ["restarts", "rounds", "step", "limit", "tolerance", "hopeless", "poor"])
"""How hard a fit tries.

restarts:  descents per target
rounds:    of exchange
step:      extent of a descent's first simplex
limit:     evaluations of a descent
tolerance: of a descent
hopeless:  a sum of squares over all targets; above it, after a first descent of each, the fit is given up
poor:      likewise, after all descents
"""

BETTER = 0.999
"""A target descends from another's optimum where the sum of squares there is below this share of its own."""

NEAR = 1.5
"""A warm start is descended from where its sum of squares is at most this many times the best without it."""


@njit(**_INNER)
def _table_row(machine, x, row, c):
    """The sums of squares of all targets at coordinates x, for one run of the program."""
    compute(machine, x)
    for target in range(row.shape[0]):
        row[target] = project(machine, target, c)


@njit(**_INNER)
def _descend(machine, target, start, descent, best_x, best_value, c):
    """One descent from a start; keeps the result where it is the target's best. Returns the evaluations."""
    x = np.empty(start.shape[0])
    copy(x, start)
    value, used = nelder_mead(machine, target, x, descent.step, descent.limit, descent.tolerance, c)
    if value < best_value[target]:
        best_value[target] = value
        copy(best_x[target], x)
    return used


@njit(**_INNER)
def _best_row(table, target, taken):
    """The finite row of the table that is best for the target and not taken; -1 for none."""
    row = -1
    for i in range(table.shape[0]):
        if not taken[i] and np.isfinite(table[i, target]) and (row < 0 or table[i, target] < table[row, target]):
            row = i
    return row


@njit(**_INNER)
def _next_row(table, target, taken):
    """The first row of the table that is finite for the target and not taken; -1 for none."""
    for i in range(table.shape[0]):
        if not taken[i] and np.isfinite(table[i, target]):
            return i
    return -1


@njit(**_INNER)
def _total(values):
    total = 0.0
    for value in values:
        total += value
    return total


@compiled.entry(**_INNER)
def fit_targets(machine, starts, near, descent, best_x, best_value):
    """Fits every target from shared starts (s, d); fills best_x (t, d) and best_value (t,).

    All starts are evaluated once for all targets, since only the closed-form part differs between them. A target
    first descends from its best start, then in turns from the best and the first of those that no target has
    taken: the best are often in the wrong valley, and it is enough that one target finds the right one. For then,
    in rounds, targets descend from the optima of others that suit them better than their own.

    Last come warm starts `near` (t or 0, d), one per target: they can only lower what was found without them.

    Returns the number of evaluations and whether the fit was finished, not given up.
    """
    t, d = best_x.shape
    table, c = np.empty((starts.shape[0], t)), np.zeros(machine.linear)
    for i in range(starts.shape[0]):
        _table_row(machine, starts[i], table[i], c)
    for target in range(t):
        best_value[target] = np.inf
        copy(best_x[target], starts[0])
    used = starts.shape[0] + _descend_from_table(machine, starts, table, descent, best_x, best_value, c)
    if _total(best_value) > descent.hopeless:
        return used, False
    for _ in range(descent.rounds if d > 0 else 0):
        used += _exchange(machine, descent, best_x, best_value, c)
    x = np.empty(d)
    for target in range(near.shape[0]):
        copy(x, near[target])
        used += 1
        if objective(machine, target, x, c) <= NEAR * best_value[target]:
            used += _descend(machine, target, near[target], descent, best_x, best_value, c)
    return used, _total(best_value) <= descent.poor


@njit(**_INNER)
def _descend_from_table(machine, starts, table, descent, best_x, best_value, c):
    s, t = table.shape
    used = 0
    nothing, taken = np.zeros(s, np.bool_), np.zeros(s, np.bool_)
    for restart in range(min(descent.restarts, s)):
        if restart == 1 and _total(best_value) > descent.hopeless:
            break
        for target in range(t):
            if restart > 1 and restart % 2 == 0:
                row = _next_row(table, target, taken)
            else:
                row = _best_row(table, target, nothing if restart == 0 else taken)
            if row >= 0:
                taken[row] = True
                used += _descend(machine, target, starts[row], descent, best_x, best_value, c)
    return used


@njit(**_INNER)
def _exchange(machine, descent, best_x, best_value, c):
    """Every target descends from the optimum of another where that suits it better than its own."""
    t = best_value.shape[0]
    optima, table = np.empty(best_x.shape), np.empty((t, t))
    for row in range(t):
        copy(optima[row], best_x[row])
        _table_row(machine, optima[row], table[row], c)
    used = t
    nothing = np.zeros(t, np.bool_)
    for target in range(t):
        row = _best_row(table, target, nothing)
        if row >= 0 and table[row, target] < BETTER * best_value[target]:
            used += _descend(machine, target, optima[row], descent, best_x, best_value, c)
    return used


@compiled.entry(**_INNER)
def polish_targets(machine, descent, best_x, best_value, best_c):
    """Descends once more from each target's best (t, d) with a small fresh simplex; fills best_c (t, k) too."""
    used = 0
    for target in range(best_value.shape[0]):
        _, evaluations = nelder_mead(
            machine,
            target,
            best_x[target],
            0.2 * descent.step,
            descent.limit,
            0.1 * descent.tolerance,
            best_c[target],
        )
        used += evaluations
        best_value[target] = objective(machine, target, best_x[target], best_c[target])
    return used


@compiled.entry(**_INNER)
def state_targets(machine, best_x, best_value, best_c):
    """The linear coefficients best_c (t, k) and sums of squares best_value (t,) at coordinates best_x (t, d)."""
    for target in range(best_value.shape[0]):
        best_value[target] = objective(machine, target, best_x[target], best_c[target])


@compiled.entry(**_INNER)
def add_squares(machine, x, c, squares):
    """Adds to squares (cells,) float64 the squared weighted residuals of every target, at what `x` and `c` say."""
    values = np.empty(BLOCK, np.float32)
    k = machine.linear
    for target in range(x.shape[0]):
        compute(machine, x[target])
        w = integers(machine.weights, target + 1)[target]
        wy = integers(machine.weighted, target + 1)[target]
        outputs = integers(machine.outputs, k + 1)
        for b in range(0, machine.cells, BLOCK):
            n, o = min(BLOCK, machine.cells - b), 4 * b
            combine(outputs, c[target], o, n, values)
            for i in range(n):
                residual = values[i] * load(w + o, i) - load(wy + o, i)
                squares[b + i] += residual * residual
