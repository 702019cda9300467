"""Values of tables at directions, compiled: the same nearest bins and linear G as in a fit."""

import math

from numba import njit

from fitters import compiled

_HALF_PI = math.pi / 2
_COS_LIMIT = math.cos(math.radians(89.0))


@njit(error_model="numpy")
def _lit(w_i, w_o):
    """Whether both directions lie above the horizon; a NaN in one is no direction and finds no table's entry."""
    return w_i[2] > 0.0 and w_o[2] > 0.0 and math.isfinite(w_i[0] + w_i[1] + w_o[0] + w_o[1])


@njit(error_model="numpy")
def _darken(values):
    for c in range(3):
        values[c] = 0.0


@njit(error_model="numpy")
def _half_diff(w_i, w_o):
    """theta_half bin, theta_diff bin, and the half vector (x, y, z) of one pair of directions."""
    x, y, z = w_i[0] + w_o[0], w_i[1] + w_o[1], w_i[2] + w_o[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-12:
        # Opposite directions along the horizon: any half vector will do.
        return 0, 89, 0.0, 0.0, 1.0
    x, y, z = x / length, y / length, z / length
    theta_half = math.atan2(math.hypot(x, y), z)
    theta_diff = math.acos(min(0.5 * length, 1.0))
    h = min(int(math.sqrt(theta_half / _HALF_PI) * 90), 89)
    d = min(int(theta_diff / _HALF_PI * 90), 89)
    return h, d, x, y, z


@njit(error_model="numpy")
def _phi_bin(w_i, x, y, z):
    """The phi_diff bin (of 180, modulo pi) of w_i about a half vector."""
    sin_h = math.hypot(x, y)
    cos_phi, sin_phi = (x / sin_h, y / sin_h) if sin_h > 1e-12 else (1.0, 0.0)
    along = w_i[0] * z * cos_phi + w_i[1] * z * sin_phi - w_i[2] * sin_h
    across = w_i[1] * cos_phi - w_i[0] * sin_phi
    return min(int(math.atan2(across, along) % math.pi / math.pi * 180), 179)


@njit(error_model="numpy")
def _node(cosine):
    """The node below an angle, and the share of the next; the angle is 89 degrees at most."""
    degrees = math.degrees(math.acos(min(max(cosine, _COS_LIMIT), 1.0)))
    node = min(int(degrees), 88)
    return node, min(degrees - node, 1.0)


@njit(error_model="numpy")
def microfacet_at(w_i, w_o, rho_d, rho_s, d, f, g, values):
    """Eq. 3 at one pair of directions into values (3,).

    Beyond 89 degrees, where nothing was fitted, G and the cosine are those at 89.
    """
    if not _lit(w_i, w_o):
        _darken(values)
        return
    h, t, _, _, _ = _half_diff(w_i, w_o)
    a, part_a = _node(w_i[2])
    b, part_b = _node(w_o[2])
    cosines = max(w_i[2], _COS_LIMIT) * max(w_o[2], _COS_LIMIT)
    for c in range(3):
        g_i = g[a, c] + part_a * (g[a + 1, c] - g[a, c])
        g_o = g[b, c] + part_b * (g[b + 1, c] - g[b, c])
        values[c] = rho_d[c] + rho_s[c] * d[h, c] * f[t, c] * g_i * g_o / cosines


@njit(error_model="numpy")
def naive_at(w_i, w_o, rho_d, rho_s, d, f, h, values):
    """Eq. 4 at one pair of directions into values (3,)."""
    if not _lit(w_i, w_o):
        _darken(values)
        return
    k, t, x, y, z = _half_diff(w_i, w_o)
    p = _phi_bin(w_i, x, y, z)
    for c in range(3):
        values[c] = rho_d[c] + rho_s[c] * d[k, c] * f[t, c] * h[p, c]


@njit(error_model="numpy")
def bivariate_at(w_i, w_o, table, values):
    """Eq. 5 at one pair of directions into values (3,)."""
    if not _lit(w_i, w_o):
        _darken(values)
        return
    h, t, _, _, _ = _half_diff(w_i, w_o)
    for c in range(3):
        values[c] = table[h, t, c]


@njit(error_model="numpy")
def measured_at(w_i, w_o, table, values):
    """The nearest cell of a table (3, 90, 90, 180) at one pair of directions into values (3,)."""
    if not _lit(w_i, w_o):
        _darken(values)
        return
    h, t, x, y, z = _half_diff(w_i, w_o)
    p = _phi_bin(w_i, x, y, z)
    for c in range(3):
        values[c] = table[c, h, t, p]


@compiled.entry(error_model="numpy")
def microfacet(w_i, w_o, rho_d, rho_s, d, f, g, values):
    """`microfacet_at` into values (n, 3)."""
    for j in range(len(w_i)):
        microfacet_at(w_i[j], w_o[j], rho_d, rho_s, d, f, g, values[j])


@compiled.entry(error_model="numpy")
def naive(w_i, w_o, rho_d, rho_s, d, f, h, values):
    """`naive_at` into values (n, 3)."""
    for j in range(len(w_i)):
        naive_at(w_i[j], w_o[j], rho_d, rho_s, d, f, h, values[j])


@compiled.entry(error_model="numpy")
def bivariate(w_i, w_o, table, values):
    """`bivariate_at` into values (n, 3)."""
    for j in range(len(w_i)):
        bivariate_at(w_i[j], w_o[j], table, values[j])
