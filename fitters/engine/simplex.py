"""Nelder-Mead over the searched parameters, inside compiled code, for all targets of one expression.

Coordinates: a parameter with a positive lower bound is searched in its logarithm, any other as it is; a step out
of the box is clipped to it. The objective is the sum of squares of `projection.py`, infinite where not finite.
"""

from collections import namedtuple

import numpy as np
from numba import njit

from fitters.engine.machine import run_scalars
from fitters.engine.math32 import call_kernel
from fitters.engine.projection import BLOCK, normal_equations, solve_box, sum_of_squares

_EXACT = {"error_model": "numpy", "cache": True}

Machine = namedtuple(
    "Machine",
    [
        "kernel",  # address of the compiled dispatch, `machine.KERNEL`
        "code",  # (instructions, 4) vector code
        "scalar_code",  # (instructions, 4) scalar code
        "registers",  # (s,) float64 scalar registers, the searched parameters first
        "scalars",  # (s,) float32 copy that vector code reads
        "base",  # (slots,) int64 addresses of the vectors
        "advance",  # (slots,) bytes per cell that an address advances: 4, or 0 for temporaries
        "slots",  # (slots,) int64 addresses at the current block
        "outputs",  # (1 + k,) int64 addresses of the outputs, 0 for no offset
        "logarithmic",  # (d,) bool: the coordinate is the parameter's logarithm
        "low",  # (d,) lower bound in coordinates
        "high",  # (d,) upper bound in coordinates
        "linear_low",  # (k,)
        "linear_high",  # (k,)
        "scratch",  # (BLOCK,) float32
        "gram",  # (k, k)
        "right",  # (k,)
    ],
)
"""Everything that one expression on one set of cells needs: arrays only, so that numba takes it as it is."""

Descent = namedtuple("Descent", ["restarts", "rounds", "step", "limit", "tolerance"])
"""Descents per target, rounds of exchange, the first simplex's extent, evaluations and tolerance of a descent."""

Data = namedtuple("Data", ["weights", "targets", "n"])
"""Addresses (t,) of the weights and the weighted targets, and the number of cells."""


@njit(**_EXACT)
def compute(machine, n, x):
    """Runs the program at coordinates x (d,) over n cells; the outputs then hold offset and coefficients."""
    for i in range(x.shape[0]):
        machine.registers[i] = np.exp(x[i]) if machine.logarithmic[i] else x[i]
    run_scalars(machine.scalar_code, machine.registers)
    for i in range(machine.registers.shape[0]):
        machine.scalars[i] = machine.registers[i]
    for b in range(0, n, BLOCK):
        for s in range(machine.base.shape[0]):
            machine.slots[s] = machine.base[s] + machine.advance[s] * b
        call_kernel(
            machine.kernel,
            machine.code.ctypes.data,
            machine.code.shape[0],
            machine.slots.ctypes.data,
            machine.scalars.ctypes.data,
            min(BLOCK, n - b),
        )


@njit(**_EXACT)
def project(machine, data, target, c):
    """The best linear coefficients c (k,) for the outputs as they stand, and their sum of squares."""
    w, wy = data.weights[target], data.targets[target]
    if c.shape[0] > 0:
        normal_equations(machine.outputs, w, wy, data.n, machine.gram, machine.right)
        if not solve_box(machine.gram, machine.right, machine.linear_low, machine.linear_high, c):
            return np.inf
    value = sum_of_squares(machine.outputs, c, w, wy, data.n, machine.scratch)
    return value if np.isfinite(value) else np.inf


@njit(**_EXACT)
def objective(machine, data, target, x, c):
    """The sum of squares of a target at coordinates x, which are clipped into the box in place."""
    for i in range(x.shape[0]):
        x[i] = min(max(x[i], machine.low[i]), machine.high[i])
    compute(machine, data.n, x)
    return project(machine, data, target, c)


@njit(**_EXACT)
def _sort(points, values):
    """Insertion sort of the simplex by value."""
    d = points.shape[1]
    for i in range(1, values.shape[0]):
        j = i
        while j > 0 and values[j] < values[j - 1]:
            values[j], values[j - 1] = values[j - 1], values[j]
            for q in range(d):
                points[j, q], points[j - 1, q] = points[j - 1, q], points[j, q]
            j -= 1


@njit(**_EXACT)
def _converged(points, values, tolerance):
    """Whether the simplex is flat in value, and small, both relative to `tolerance`."""
    if not values[-1] - values[0] <= tolerance * abs(values[0]):
        return False
    extent = 0.0
    for i in range(1, points.shape[0]):
        for q in range(points.shape[1]):
            extent = max(extent, abs(points[i, q] - points[0, q]))
    return extent <= np.sqrt(tolerance)


@njit(**_EXACT)
def nelder_mead(machine, data, target, x, step, limit, tolerance, c):
    """Minimises from x (d,) in place, within `limit` evaluations (Nelder and Mead 1965, standard coefficients).

    Returns the sum of squares and the evaluations used.
    """
    d = x.shape[0]
    points, values = np.empty((d + 1, d)), np.empty(d + 1)
    for i in range(d + 1):
        points[i] = x
        if i > 0:
            up = x[i - 1] + step <= machine.high[i - 1]
            points[i, i - 1] = x[i - 1] + step if up else x[i - 1] - step
        values[i] = objective(machine, data, target, points[i], c)
    used = d + 1
    centre, trial, second = np.empty(d), np.empty(d), np.empty(d)
    while d > 0:
        _sort(points, values)
        if used >= limit or not np.isfinite(values[0]) or _converged(points, values, tolerance):
            break
        for q in range(d):
            centre[q] = 0.0
            for i in range(d):
                centre[q] += points[i, q] / d
            trial[q] = 2.0 * centre[q] - points[d, q]
        value = objective(machine, data, target, trial, c)
        used += 1
        if value < values[0]:
            for q in range(d):
                second[q] = 3.0 * centre[q] - 2.0 * points[d, q]
            expanded = objective(machine, data, target, second, c)
            used += 1
            if expanded < value:
                points[d], values[d] = second, expanded
            else:
                points[d], values[d] = trial, value
            continue
        if value < values[d - 1]:
            points[d], values[d] = trial, value
            continue
        outside = value < values[d]
        for q in range(d):
            other = 1.5 * centre[q] - 0.5 * points[d, q] if outside else 0.5 * (centre[q] + points[d, q])
            second[q] = other
        contracted = objective(machine, data, target, second, c)
        used += 1
        if contracted < min(value, values[d]):
            points[d], values[d] = second, contracted
            continue
        for i in range(1, d + 1):
            for q in range(d):
                points[i, q] = 0.5 * (points[0, q] + points[i, q])
            values[i] = objective(machine, data, target, points[i], c)
        used += d
    x[:] = points[0]
    return values[0], used


@njit(**_EXACT)
def _table_row(machine, data, x, row, c):
    """The sums of squares of all targets at coordinates x, for one run of the program."""
    compute(machine, data.n, x)
    for target in range(row.shape[0]):
        row[target] = project(machine, data, target, c)


@njit(**_EXACT)
def _descend(machine, data, target, start, settings, best_x, best_value, c):
    """One descent from a start; keeps the result where it is the target's best. Returns the evaluations."""
    x = start.copy()
    value, used = nelder_mead(machine, data, target, x, settings.step, settings.limit, settings.tolerance, c)
    if value < best_value[target]:
        best_value[target] = value
        best_x[target] = x
    return used


@njit(**_EXACT)
def _best_row(table, target, count, taken):
    """The finite row of `table[:count]` that is best for the target and not taken; -1 for none."""
    row = -1
    for i in range(count):
        if not taken[i] and np.isfinite(table[i, target]) and (row < 0 or table[i, target] < table[row, target]):
            row = i
    return row


@njit(**_EXACT)
def fit_targets(machine, data, starts, settings, best_x, best_value):
    """Fits every target from shared starts (s, d); fills best_x (t, d) and best_value (t,).

    All starts are evaluated once for all targets, since only the closed-form part differs between them. A
    target first descends from its best start and from others in turn: the best start is often in the wrong
    valley, and no two targets take the same others. Then, in rounds, every target descends from the optima of
    others that suit it best. Returns the number of evaluations.
    """
    s, d = starts.shape
    t = best_value.shape[0]
    table, c = np.full((s, t), np.inf), np.zeros(machine.right.shape[0])
    for i in range(s):
        _table_row(machine, data, starts[i], table[i], c)
    used = s
    best_value[:] = np.inf
    best_x[:] = starts[0]
    taken = np.zeros(s, np.bool_)
    following = 0
    for target in range(t):
        taken[:] = False
        for restart in range(min(settings.restarts, s)):
            row = _best_row(table, target, s, taken)
            if row >= 0 and restart > 0:
                while taken[following % s] or not np.isfinite(table[following % s, target]):
                    following += 1
                row = following % s
            if row < 0:
                break
            taken[row] = True
            used += _descend(machine, data, target, starts[row], settings, best_x, best_value, c)
    for rank in range(settings.rounds if d > 0 else 0):
        used += _exchange(machine, data, settings, rank, best_x, best_value, c)
    return used


@njit(**_EXACT)
def _exchange(machine, data, settings, rank, best_x, best_value, c):
    """Every target descends once from that optimum of another target which suits it best, or `rank` places after."""
    t = best_value.shape[0]
    found, table, taken = best_x.copy(), np.full((t, t), np.inf), np.zeros(t, np.bool_)
    for row in range(t):
        _table_row(machine, data, found[row], table[row], c)
    used = t
    for target in range(t):
        taken[:] = False
        taken[target] = True
        row = -1
        for _ in range(rank + 1):
            row = _best_row(table, target, t, taken)
            if row < 0:
                break
            taken[row] = True
        if row >= 0:
            used += _descend(machine, data, target, found[row], settings, best_x, best_value, c)
    return used


@njit(**_EXACT)
def polish_targets(machine, data, settings, best_x, best_value, best_c):
    """Descends once more from each target's best (t, d) with a small fresh simplex; fills best_c (t, k) too."""
    used = 0
    x = np.empty(best_x.shape[1])
    for target in range(best_value.shape[0]):
        x[:] = best_x[target]
        value, evaluations = nelder_mead(
            machine,
            data,
            target,
            x,
            0.2 * settings.step,
            settings.limit,
            0.01 * settings.tolerance,
            best_c[target],
        )
        used += evaluations
        if not value > best_value[target]:
            best_x[target] = x
        best_value[target] = objective(machine, data, target, best_x[target], best_c[target])
    return used
