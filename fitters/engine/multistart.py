"""Many descents for all targets of one expression: from a table of starts, then from the optima of other targets."""

from collections import namedtuple

import numpy as np
from numba import njit

from fitters.engine.objective import compute, objective, project
from fitters.engine.simplex import copy, nelder_mead

_INNER = {"error_model": "numpy"}
_ENTRY = {"error_model": "numpy", "cache": True}

Descent = namedtuple("Descent", ["restarts", "rounds", "step", "limit", "tolerance"])
"""Descents per target, rounds of exchange, the first simplex's extent, evaluations and tolerance of a descent."""


@njit(**_INNER)
def _table_row(machine, x, row, c):
    """The sums of squares of all targets at coordinates x, for one run of the program."""
    compute(machine, x)
    for target in range(row.shape[0]):
        row[target] = project(machine, target, c)


@njit(**_INNER)
def _descend(machine, target, start, settings, best_x, best_value, c):
    """One descent from a start; keeps the result where it is the target's best. Returns the evaluations."""
    x = np.empty(start.shape[0])
    copy(x, start)
    value, used = nelder_mead(machine, target, x, settings.step, settings.limit, settings.tolerance, c)
    if value < best_value[target]:
        best_value[target] = value
        copy(best_x[target], x)
    return used


@njit(**_INNER)
def _best_row(table, target, count, taken):
    """The finite row of `table[:count]` that is best for the target and not taken; -1 for none."""
    row = -1
    for i in range(count):
        if not taken[i] and np.isfinite(table[i, target]) and (row < 0 or table[i, target] < table[row, target]):
            row = i
    return row


@njit(**_ENTRY)
def fit_targets(machine, starts, settings, best_x, best_value):
    """Fits every target from shared starts (s, d); fills best_x (t, d) and best_value (t,).

    All starts are evaluated once for all targets, since only the closed-form part differs between them. A
    target first descends from its best start and from others in turn: the best start is often in the wrong
    valley, and no two targets take the same others. Then, in rounds, every target descends from the optima of
    others that suit it best. Returns the number of evaluations.
    """
    s, d = starts.shape
    t = best_value.shape[0]
    table, c = np.empty((s, t)), np.zeros(machine.linear)
    nothing = np.zeros(s, np.bool_)
    for i in range(s):
        _table_row(machine, starts[i], table[i], c)
    used = s
    taken = np.zeros(s, np.bool_)
    for target in range(t):
        best_value[target] = np.inf
        copy(best_x[target], starts[0])
    for restart in range(min(settings.restarts, s)):
        for target in range(t):
            if restart == 0:
                row = _best_row(table, target, s, nothing)
            else:
                row = _best_row(table, target, s, taken)
            if row >= 0:
                taken[row] = True
                used += _descend(machine, target, starts[row], settings, best_x, best_value, c)
    for rank in range(settings.rounds if d > 0 else 0):
        used += _exchange(machine, settings, rank, best_x, best_value, c)
    return used


@njit(**_INNER)
def _exchange(machine, settings, rank, best_x, best_value, c):
    """Every target descends once from the optimum of another that suits it best, or `rank` places after."""
    t = best_value.shape[0]
    found, table = np.empty(best_x.shape), np.empty((t, t))
    for row in range(t):
        copy(found[row], best_x[row])
        _table_row(machine, found[row], table[row], c)
    used = t
    for target in range(t):
        taken = np.zeros(t, np.bool_)
        taken[target] = True
        row = -1
        for _ in range(rank + 1):
            row = _best_row(table, target, t, taken)
            if row < 0:
                break
            taken[row] = True
        if row >= 0:
            used += _descend(machine, target, found[row], settings, best_x, best_value, c)
    return used


@njit(**_ENTRY)
def polish_targets(machine, settings, best_x, best_value, best_c):
    """Descends once more from each target's best (t, d) with a small fresh simplex; fills best_c (t, k) too."""
    used = 0
    x = np.empty(best_x.shape[1])
    for target in range(best_value.shape[0]):
        copy(x, best_x[target])
        _, evaluations = nelder_mead(
            machine,
            target,
            x,
            0.2 * settings.step,
            settings.limit,
            0.01 * settings.tolerance,
            best_c[target],
        )
        used += evaluations
        copy(best_x[target], x)
        best_value[target] = objective(machine, target, best_x[target], best_c[target])
    return used
