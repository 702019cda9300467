"""Nelder-Mead over the searched parameters of one target (Nelder and Mead 1965), inside compiled code."""

import numpy as np
from numba import njit

from fitters.engine.objective import objective, reals

_INNER = {"error_model": "numpy"}


@njit(**_INNER)
def copy(target, source):
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
    box = reals(machine.box, 2, d)
    points, values = np.empty((d + 1, d)), np.empty(d + 1)
    for i in range(d + 1):
        copy(points[i], x)
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
                copy(trial, second)
        if value < values[d - 1]:
            values[d] = value
            copy(points[d], trial)
            continue
        outside = value < values[d]
        for q in range(d):
            other = 1.5 * centre[q] - 0.5 * points[d, q] if outside else 0.5 * (centre[q] + points[d, q])
            second[q] = other
        contracted = objective(machine, target, second, c)
        used += 1
        if contracted < min(value, values[d]):
            values[d] = contracted
            copy(points[d], second)
            continue
        for i in range(1, d + 1):
            for q in range(d):
                points[i, q] = 0.5 * (points[0, q] + points[i, q])
            values[i] = objective(machine, target, points[i], c)
        used += d
    copy(x, points[0])
    return values[0], used
