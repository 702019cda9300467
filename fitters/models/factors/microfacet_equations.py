"""One pass over all samples: the objective, its gradient and the Gauss-Newton matrix of D, F and G.

The unknowns are rho_d and the logarithms of D (90, which holds rho_s too), F (90) and G (90): 271 in this order.
A sample's residual is r = rho_d + s - z with s = D F G_i G_o / (cos theta_i cos theta_o), and the derivative of s
by the logarithm of a factor is s, times a node's share in the interpolation for G.
"""

import numpy as np

from fitters import compiled

SIZE = 271
_D, _F, _G = 1, 91, 181


@compiled.entry(fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")
def objective(rho_d, d, f, g, offset, node_i, node_o, part_i, part_o, cosines, weights, values):
    """Sum of w r^2 (eq. 7), without the samples' constant. `d`, `f`, `g` (90,) are the factors themselves."""
    total = 0.0
    for h in range(90):
        for t in range(90):
            base = d[h] * f[t]
            for j in range(offset[h * 90 + t], offset[h * 90 + t + 1]):
                a, b = node_i[j], node_o[j]
                g_i = g[a] + part_i[j] * (g[a + 1] - g[a])
                g_o = g[b] + part_o[j] * (g[b + 1] - g[b])
                r = rho_d + base * g_i * g_o / cosines[j] - values[j]
                total += weights[j] * r * r
    return total


@compiled.entry(fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")
def normal_equations(rho_d, d, f, g, offset, node_i, node_o, part_i, part_o, cosines, weights, values, grad, hess):
    """Fills grad (271,), half the objective's gradient, and hess (271, 271); returns the objective."""
    grad[:] = 0.0
    hess[:] = 0.0
    total = 0.0
    row = np.empty(90)
    cross, near, diagonal = np.zeros((90, 90)), np.zeros(90), np.zeros(90)
    for h in range(90):
        for t in range(90):
            begin, end = offset[h * 90 + t], offset[h * 90 + t + 1]
            if begin == end:
                continue
            base = d[h] * f[t]
            row[:] = 0.0
            sum_s, sum_ss, sum_rs = 0.0, 0.0, 0.0
            for j in range(begin, end):
                a, b = node_i[j], node_o[j]
                rise_i, rise_o = part_i[j] * g[a + 1], part_o[j] * g[b + 1]
                g_i, g_o = g[a] - part_i[j] * g[a] + rise_i, g[b] - part_o[j] * g[b] + rise_o
                s = base * g_i * g_o / cosines[j]
                r = rho_d + s - values[j]
                w = weights[j]
                share_i, share_o = rise_i / g_i, rise_o / g_o
                rest_i, rest_o = 1.0 - share_i, 1.0 - share_o
                total += w * r * r
                grad[0] += w * r
                hess[0, 0] += w
                ws = w * s
                wss, wsr = ws * s, ws * r
                sum_s += ws
                sum_ss += wss
                sum_rs += wsr
                row[a] += wss * rest_i
                row[a + 1] += wss * share_i
                row[b] += wss * rest_o
                row[b + 1] += wss * share_o
                grad[_G + a] += wsr * rest_i
                grad[_G + a + 1] += wsr * share_i
                grad[_G + b] += wsr * rest_o
                grad[_G + b + 1] += wsr * share_o
                hess[0, _G + a] += ws * rest_i
                hess[0, _G + a + 1] += ws * share_i
                hess[0, _G + b] += ws * rest_o
                hess[0, _G + b + 1] += ws * share_o
                diagonal[a] += wss * rest_i * rest_i
                diagonal[a + 1] += wss * share_i * share_i
                near[a] += wss * rest_i * share_i
                diagonal[b] += wss * rest_o * rest_o
                diagonal[b + 1] += wss * share_o * share_o
                near[b] += wss * rest_o * share_o
                from_i, to_i = wss * rest_i, wss * share_i
                cross[a, b] += from_i * rest_o
                cross[a, b + 1] += from_i * share_o
                cross[a + 1, b] += to_i * rest_o
                cross[a + 1, b + 1] += to_i * share_o
            grad[_D + h] += sum_rs
            grad[_F + t] += sum_rs
            hess[0, _D + h] += sum_s
            hess[0, _F + t] += sum_s
            hess[_D + h, _D + h] += sum_ss
            hess[_F + t, _F + t] += sum_ss
            hess[_D + h, _F + t] = sum_ss
            for k in range(90):
                hess[_D + h, _G + k] += row[k]
                hess[_F + t, _G + k] += row[k]
    for a in range(90):
        hess[_G + a, _G + a] += diagonal[a]
        if a < 89:
            hess[_G + a, _G + a + 1] += near[a]
        for b in range(a, 90):
            hess[_G + a, _G + b] += cross[a, b] + cross[b, a]
    for a in range(SIZE):
        for b in range(a):
            hess[a, b] = hess[b, a]
    return total
