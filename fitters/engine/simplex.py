"""Nelder-Mead over the searched parameters, inside compiled code, for all targets of one expression.

Coordinates: a parameter with a positive lower bound is searched in its logarithm, any other as it is; a step out
of the box is clipped to it. The objective is the sum of squares of `projection.py`, infinite where not finite.
"""

from collections import namedtuple

import numpy as np
from numba import carray, njit, types

from fitters.engine.machine import run_scalars
from fitters.engine.math32 import address_as, call_kernel
from fitters.engine.projection import BLOCK, normal_equations, solve_box, sum_of_squares

_INNER = {"error_model": "numpy"}
_ENTRY = {"error_model": "numpy", "cache": True}

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

Descent = namedtuple("Descent", ["restarts", "rounds", "step", "limit", "tolerance"])
"""Descents per target, rounds of exchange, the first simplex's extent, evaluations and tolerance of a descent."""


@njit(**_INNER)
def _reals(address, *shape):
    return carray(address_as(address, types.float64), shape)


@njit(**_INNER)
def _integers(address, count):
    return carray(address_as(address, types.int64), (count,))


@njit(**_INNER)
def compute(machine, x):
    """Runs the program at coordinates x (searched,); the outputs then hold offset and coefficients."""
    registers = _reals(machine.registers, machine.registers_count)
    logarithmic = _reals(machine.logarithmic, machine.searched)
    for i in range(x.shape[0]):
        registers[i] = np.exp(x[i]) if logarithmic[i] > 0.0 else x[i]
    run_scalars(carray(address_as(machine.scalar_code, types.int32), (machine.scalar_instructions, 4)), registers)
    scalars = carray(address_as(machine.scalars, types.float32), (machine.registers_count,))
    for i in range(machine.registers_count):
        scalars[i] = registers[i]
    base, advance = _integers(machine.base, machine.slots_count), _integers(machine.advance, machine.slots_count)
    slots = _integers(machine.slots, machine.slots_count)
    for b in range(0, machine.cells, BLOCK):
        for s in range(machine.slots_count):
            slots[s] = base[s] + advance[s] * b
        n = min(BLOCK, machine.cells - b)
        call_kernel(machine.kernel, machine.code, machine.instructions, machine.slots, machine.scalars, n)


@njit(**_INNER)
def project(machine, target, c):
    """The best linear coefficients c (linear,) for the outputs as they stand, and their sum of squares."""
    k = c.shape[0]
    w = _integers(machine.weights, target + 1)[target]
    wy = _integers(machine.weighted, target + 1)[target]
    outputs = _integers(machine.outputs, k + 1)
    if k > 0:
        normal, box = _reals(machine.normal, k + 1, k), _reals(machine.linear_box, 2, k)
        normal_equations(outputs, w, wy, machine.cells, normal[:k], normal[k])
        if not solve_box(normal[:k], normal[k], box[0], box[1], c):
            return np.inf
    scratch = carray(address_as(machine.scratch, types.float32), (BLOCK,))
    value = sum_of_squares(outputs, c, w, wy, machine.cells, scratch)
    return value if np.isfinite(value) else np.inf


@njit(**_INNER)
def objective(machine, target, x, c):
    """The sum of squares of a target at coordinates x, which are clipped into the box in place."""
    box = _reals(machine.box, 2, machine.searched)
    for i in range(x.shape[0]):
        x[i] = min(max(x[i], box[0, i]), box[1, i])
    compute(machine, x)
    return project(machine, target, c)


@njit(**_INNER)
def _copy(target, source):
    """target = source, rows of equal length; a loop compiles ten times faster than a general assignment."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@njit(**_INNER)
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


@njit(**_INNER)
def _converged(points, values, tolerance):
    """Whether the simplex is flat in value, and small, both relative to `tolerance`."""
    if not values[-1] - values[0] <= tolerance * abs(values[0]):
        return False
    extent = 0.0
    for i in range(1, points.shape[0]):
        for q in range(points.shape[1]):
            extent = max(extent, abs(points[i, q] - points[0, q]))
    return extent <= np.sqrt(tolerance)


@njit(**_INNER)
def nelder_mead(machine, target, x, step, limit, tolerance, c):
    """Minimises from x (d,) in place, within `limit` evaluations (Nelder and Mead 1965, standard coefficients).

    Returns the sum of squares and the evaluations used.
    """
    d = x.shape[0]
    box = _reals(machine.box, 2, d)
    points, values = np.empty((d + 1, d)), np.empty(d + 1)
    for i in range(d + 1):
        _copy(points[i], x)
        if i > 0:
            # A box narrower than the step gets a simplex that fits into it.
            extent = min(step, 0.5 * (box[1, i - 1] - box[0, i - 1]))
            up = x[i - 1] + extent <= box[1, i - 1]
            points[i, i - 1] = x[i - 1] + extent if up else x[i - 1] - extent
        values[i] = objective(machine, target, points[i], c)
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
        value = objective(machine, target, trial, c)
        used += 1
        if value < values[0]:
            for q in range(d):
                second[q] = 3.0 * centre[q] - 2.0 * points[d, q]
            expanded = objective(machine, target, second, c)
            used += 1
            if expanded < value:
                value = expanded
                _copy(trial, second)
        if value < values[d - 1]:
            values[d] = value
            _copy(points[d], trial)
            continue
        outside = value < values[d]
        for q in range(d):
            other = 1.5 * centre[q] - 0.5 * points[d, q] if outside else 0.5 * (centre[q] + points[d, q])
            second[q] = other
        contracted = objective(machine, target, second, c)
        used += 1
        if contracted < min(value, values[d]):
            values[d] = contracted
            _copy(points[d], second)
            continue
        for i in range(1, d + 1):
            for q in range(d):
                points[i, q] = 0.5 * (points[0, q] + points[i, q])
            values[i] = objective(machine, target, points[i], c)
        used += d
    _copy(x, points[0])
    return values[0], used


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
    _copy(x, start)
    value, used = nelder_mead(machine, target, x, settings.step, settings.limit, settings.tolerance, c)
    if value < best_value[target]:
        best_value[target] = value
        _copy(best_x[target], x)
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
    for i in range(s):
        _table_row(machine, starts[i], table[i], c)
    used = s
    following = 0
    for target in range(t):
        best_value[target] = np.inf
        _copy(best_x[target], starts[0])
        taken = np.zeros(s, np.bool_)
        for restart in range(min(settings.restarts, s)):
            row = _best_row(table, target, s, taken)
            if row >= 0 and restart > 0:
                while taken[following % s] or not np.isfinite(table[following % s, target]):
                    following += 1
                row = following % s
            if row < 0:
                break
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
        _copy(found[row], best_x[row])
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
        _copy(x, best_x[target])
        value, evaluations = nelder_mead(
            machine,
            target,
            x,
            0.2 * settings.step,
            settings.limit,
            0.01 * settings.tolerance,
            best_c[target],
        )
        used += evaluations
        if not value > best_value[target]:
            _copy(best_x[target], x)
        best_value[target] = objective(machine, target, best_x[target], best_c[target])
    return used
