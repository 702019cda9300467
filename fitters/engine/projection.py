"""The linear parameters in closed form: weighted least squares within a box, on what the machine computed.

With weights w, the target y and the outputs a_0 (offset), a_1.. a_k of a program, this minimises over c

    SS(c) = sum over cells of (w (a_0 + sum_j c_j a_j) - w y)^2      low <= c <= high.

SS is then summed from the residuals themselves: from the normal equations it would lose half its digits.
"""

import numpy as np
from numba import njit

from fitters import compiled
from fitters.backends.math32 import FLAGS, ZERO, load

_LOOP = {"fastmath": FLAGS, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_INNER = {"error_model": "numpy"}

BLOCK = 1024
"""Cells per block: a dozen vectors of it fit the first-level cache."""


@njit(**_LOOP)
def _inner(a, b, w, n):
    """Sum of a b w^2 over n cells."""
    total = ZERO
    for i in range(n):
        weight = load(w, i)
        total += (load(a, i) * weight) * (load(b, i) * weight)
    return total


@njit(**_LOOP)
def _inner_target(a, w, wy, n):
    """Sum of a w (w y) over n cells."""
    total = ZERO
    for i in range(n):
        total += load(a, i) * load(w, i) * load(wy, i)
    return total


@njit(**_LOOP)
def _moments_1(a1, w, wy, n):
    """Gram entry and right side of one coefficient."""
    g11, r1 = ZERO, ZERO
    for i in range(n):
        u1 = load(a1, i) * load(w, i)
        g11 += u1 * u1
        r1 += u1 * load(wy, i)
    return g11, r1


@njit(**_LOOP)
def _moments_1_offset(a0, a1, w, wy, n):
    g11, r1 = ZERO, ZERO
    for i in range(n):
        weight = load(w, i)
        u1 = load(a1, i) * weight
        g11 += u1 * u1
        r1 += u1 * (load(wy, i) - load(a0, i) * weight)
    return g11, r1


@njit(**_LOOP)
def _moments_2(a1, a2, w, wy, n):
    """Gram entries 11, 12, 22 and right sides 1, 2 of two coefficients, in one pass."""
    g11, g12, g22, r1, r2 = ZERO, ZERO, ZERO, ZERO, ZERO
    for i in range(n):
        weight = load(w, i)
        y = load(wy, i)
        u1 = load(a1, i) * weight
        u2 = load(a2, i) * weight
        g11 += u1 * u1
        g12 += u1 * u2
        g22 += u2 * u2
        r1 += u1 * y
        r2 += u2 * y
    return g11, g12, g22, r1, r2


@njit(**_LOOP)
def _moments_2_offset(a0, a1, a2, w, wy, n):
    g11, g12, g22, r1, r2 = ZERO, ZERO, ZERO, ZERO, ZERO
    for i in range(n):
        weight = load(w, i)
        y = load(wy, i) - load(a0, i) * weight
        u1 = load(a1, i) * weight
        u2 = load(a2, i) * weight
        g11 += u1 * u1
        g12 += u1 * u2
        g22 += u2 * u2
        r1 += u1 * y
        r2 += u2 * y
    return g11, g12, g22, r1, r2


@njit(**_LOOP)
def _residual_0(a0, w, wy, n):
    total = ZERO
    for i in range(n):
        r = load(a0, i) * load(w, i) - load(wy, i)
        total += r * r
    return total


@njit(**_LOOP)
def _residual_1(a1, c1, w, wy, n):
    total = ZERO
    for i in range(n):
        r = c1 * load(a1, i) * load(w, i) - load(wy, i)
        total += r * r
    return total


@njit(**_LOOP)
def _residual_1_offset(a0, a1, c1, w, wy, n):
    total = ZERO
    for i in range(n):
        r = (load(a0, i) + c1 * load(a1, i)) * load(w, i) - load(wy, i)
        total += r * r
    return total


@njit(**_LOOP)
def _residual_2(a1, a2, c1, c2, w, wy, n):
    total = ZERO
    for i in range(n):
        r = (c1 * load(a1, i) + c2 * load(a2, i)) * load(w, i) - load(wy, i)
        total += r * r
    return total


@njit(**_LOOP)
def _residual_2_offset(a0, a1, a2, c1, c2, w, wy, n):
    total = ZERO
    for i in range(n):
        r = (load(a0, i) + c1 * load(a1, i) + c2 * load(a2, i)) * load(w, i) - load(wy, i)
        total += r * r
    return total


@njit(**_LOOP)
def _combine(target, a, c, n, first):
    """target (a float32 array) = c a, or += c a."""
    if first:
        for i in range(n):
            target[i] = c * load(a, i)
    else:
        for i in range(n):
            target[i] += c * load(a, i)


@njit(**_LOOP)
def _residual_array(f, w, wy, n):
    total = ZERO
    for i in range(n):
        r = f[i] * load(w, i) - load(wy, i)
        total += r * r
    return total


@njit(**_INNER)
def sum_of_squares(outputs, c, w, wy, n, scratch):
    """SS(c) over n cells; `outputs` are addresses (1 + k,), 0 for no offset, w and wy addresses too."""
    k = c.shape[0]
    offset = outputs[0] != 0
    total = 0.0
    for b in range(0, n, BLOCK):
        m = min(BLOCK, n - b)
        o = 4 * b
        if k == 0:
            total += _residual_0(outputs[0] + o, w + o, wy + o, m)
        elif k == 1:
            a1, c1 = outputs[1] + o, np.float32(c[0])
            if offset:
                total += _residual_1_offset(outputs[0] + o, a1, c1, w + o, wy + o, m)
            else:
                total += _residual_1(a1, c1, w + o, wy + o, m)
        elif k == 2:
            a1, a2, c1, c2 = outputs[1] + o, outputs[2] + o, np.float32(c[0]), np.float32(c[1])
            if offset:
                total += _residual_2_offset(outputs[0] + o, a1, a2, c1, c2, w + o, wy + o, m)
            else:
                total += _residual_2(a1, a2, c1, c2, w + o, wy + o, m)
        else:
            combine(outputs, c, o, m, scratch)
            total += _residual_array(scratch, w + o, wy + o, m)
    return total


@njit(**_INNER)
def combine(outputs, c, o, n, values):
    """values (n,) = a_0 + sum_j c_j a_j over the n cells that begin `o` bytes into the outputs."""
    first = True
    if outputs[0] != 0:
        _combine(values, outputs[0] + o, np.float32(1.0), n, first)
        first = False
    for j in range(c.shape[0]):
        _combine(values, outputs[1 + j] + o, np.float32(c[j]), n, first)
        first = False


@njit(**_INNER)
def normal_equations(outputs, w, wy, n, gram, right):
    """gram (k, k) = A^T W^2 A and right (k,) = A^T W^2 (y - a_0), added up per block in float64."""
    k = right.shape[0]
    offset = outputs[0] != 0
    gram[:] = 0.0
    right[:] = 0.0
    for b in range(0, n, BLOCK):
        m = min(BLOCK, n - b)
        o = 4 * b
        if k == 1:
            a1 = outputs[1] + o
            if offset:
                g11, r1 = _moments_1_offset(outputs[0] + o, a1, w + o, wy + o, m)
            else:
                g11, r1 = _moments_1(a1, w + o, wy + o, m)
            gram[0, 0] += g11
            right[0] += r1
        elif k == 2:
            a1, a2 = outputs[1] + o, outputs[2] + o
            if offset:
                g11, g12, g22, r1, r2 = _moments_2_offset(outputs[0] + o, a1, a2, w + o, wy + o, m)
            else:
                g11, g12, g22, r1, r2 = _moments_2(a1, a2, w + o, wy + o, m)
            gram[0, 0] += g11
            gram[1, 0] += g12
            gram[1, 1] += g22
            right[0] += r1
            right[1] += r2
        else:
            _add_moments(outputs, o, w + o, wy + o, m, gram, right)
    for i in range(k):
        for j in range(i):
            gram[j, i] = gram[i, j]


@njit(**_INNER)
def _add_moments(outputs, o, w, wy, n, gram, right):
    """Adds the moments of any number of coefficients over one block, a pass for each."""
    for i in range(right.shape[0]):
        a = outputs[1 + i] + o
        for j in range(i + 1):
            gram[i, j] += _inner(a, outputs[1 + j] + o, w, n)
        right[i] += _inner_target(a, w, wy, n)
        if outputs[0] != 0:
            right[i] -= _inner(a, outputs[0] + o, w, n)


@njit(**_INNER)
def _solve_free(gram, right, fixed, state, c):
    """Solves for the entries of c with state 0, the rest held at `fixed`. False where that is singular."""
    k = right.shape[0]
    index = np.empty(k, np.int64)
    m = 0
    for i in range(k):
        if state[i] == 0:
            index[m] = i
            m += 1
        else:
            c[i] = fixed[i]
    matrix = np.empty((m, m + 1))
    for r in range(m):
        for s in range(m):
            matrix[r, s] = gram[index[r], index[s]]
        matrix[r, m] = right[index[r]]
        for i in range(k):
            if state[i] != 0:
                matrix[r, m] -= gram[index[r], i] * fixed[i]
    for r in range(m):
        # The matrix is scaled to a unit diagonal: what is left of a pivot is what the others do not explain.
        if not matrix[r, r] > 1e-10:
            return False
        for s in range(r + 1, m):
            factor = matrix[s, r] / matrix[r, r]
            for q in range(r, m + 1):
                matrix[s, q] -= factor * matrix[r, q]
    for r in range(m - 1, -1, -1):
        value = matrix[r, m]
        for s in range(r + 1, m):
            value -= matrix[r, s] * c[index[s]]
        c[index[r]] = value / matrix[r, r]
    return True


@njit(**_INNER)
def _clamp(value, low, high):
    return min(max(value, low), high)


@njit(**_INNER)
def _solve_1(gram, right, low, high, c):
    c[0] = _clamp(right[0] / gram[0, 0], low[0], high[0]) if gram[0, 0] > 0.0 else low[0]
    return True


@njit(**_INNER)
def _solve_2(gram, right, low, high, c):
    """Two coefficients: inside the box, or the best point of its four edges."""
    g11, g12, g22, r1, r2 = gram[0, 0], gram[0, 1], gram[1, 1], right[0], right[1]
    determinant = g11 * g22 - g12 * g12
    # What is left of a pivot, relative to its entry, is what the other coefficient does not explain.
    if determinant > 1e-10 * g11 * g22:
        c[0] = (r1 * g22 - r2 * g12) / determinant
        c[1] = (r2 * g11 - r1 * g12) / determinant
        if low[0] <= c[0] <= high[0] and low[1] <= c[1] <= high[1]:
            return True
    best = np.inf
    for edge in range(4):
        if edge < 2:
            x = low[0] if edge == 0 else high[0]
            y = _clamp((r2 - g12 * x) / g22, low[1], high[1]) if g22 > 0.0 else low[1]
        else:
            y = low[1] if edge == 2 else high[1]
            x = _clamp((r1 - g12 * y) / g11, low[0], high[0]) if g11 > 0.0 else low[0]
        value = x * (0.5 * g11 * x + g12 * y - r1) + y * (0.5 * g22 * y - r2)
        if value < best:
            best = value
            c[0], c[1] = x, y
    return best < np.inf


@compiled.entry(**_INNER)
def solve_box(gram, right, low, high, c):
    """c minimising c^T gram c / 2 - right^T c in the box, exactly: every active set is tried where one is.

    False where a coefficient is not finite or all are zero everywhere.
    """
    k = right.shape[0]
    for i in range(k):
        if not (np.isfinite(gram[i, i]) and np.isfinite(right[i])):
            return False
    if k == 1:
        return _solve_1(gram, right, low, high, c)
    if k == 2:
        return _solve_2(gram, right, low, high, c)
    return _solve_any(gram, right, low, high, c)


@njit(**_INNER)
def _solve_any(gram, right, low, high, c):
    k = right.shape[0]
    scale = np.empty(k)
    for i in range(k):
        scale[i] = np.sqrt(gram[i, i]) if gram[i, i] > 0.0 else 1.0
    g = np.empty((k, k))
    r = np.empty(k)
    lower, upper, fixed, trial = np.empty(k), np.empty(k), np.empty(k), np.empty(k)
    for i in range(k):
        r[i] = right[i] / scale[i]
        lower[i], upper[i] = low[i] * scale[i], high[i] * scale[i]
        for j in range(k):
            g[i, j] = gram[i, j] / (scale[i] * scale[j])
    state = np.zeros(k, np.int64)
    best = np.inf
    for number in range(3**k):
        rest = number
        for i in range(k):
            state[i] = rest % 3
            rest //= 3
            fixed[i] = lower[i] if state[i] == 1 else upper[i]
        if not _solve_free(g, r, fixed, state, trial):
            continue
        inside = True
        for i in range(k):
            inside = inside and lower[i] <= trial[i] <= upper[i]
        if not inside:
            continue
        value = 0.0
        for i in range(k):
            value -= r[i] * trial[i]
            for j in range(k):
                value += 0.5 * trial[i] * g[i, j] * trial[j]
        if value < best:
            best = value
            for i in range(k):
                c[i] = min(max(trial[i] / scale[i], low[i]), high[i])
        if number == 0:
            break
    return best < np.inf
