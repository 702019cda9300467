"""The objective and the Gauss-Newton matrix of the naive model, rho_d + rho_s D(theta_h) F(theta_d) H(phi_d).

The unknowns are rho_d and the logarithms of D (90, which holds rho_s too), F (90) and H (180): 361 in this order.
"""

from fitters import compiled

SIZE = 361
_D, _F, _H = 1, 91, 181


@compiled.entry(fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")
def objective(rho_d, d, f, h, offset, first, weights, values):
    """Sum of w r^2 (eq. 7)."""
    total = 0.0
    for i in range(90):
        for t in range(90):
            base, begin = d[i] * f[t], offset[i * 90 + t]
            shift = first[i, t] - begin
            for j in range(begin, offset[i * 90 + t + 1]):
                r = rho_d + base * h[j + shift] - values[j]
                total += weights[j] * r * r
    return total


@compiled.entry(fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")
def normal_equations(rho_d, d, f, h, offset, first, weights, values, grad, hess):
    """Fills grad (361,), half the objective's gradient, and hess (361, 361); returns the objective."""
    grad[:] = 0.0
    hess[:] = 0.0
    total = 0.0
    for i in range(90):
        for t in range(90):
            base, begin = d[i] * f[t], offset[i * 90 + t]
            shift = first[i, t] - begin
            sum_w, sum_r, sum_s, sum_ss, sum_rs = 0.0, 0.0, 0.0, 0.0, 0.0
            for j in range(begin, offset[i * 90 + t + 1]):
                k = _H + j + shift
                s = base * h[j + shift]
                r = rho_d + s - values[j]
                w = weights[j]
                ws = w * s
                wss, wsr = ws * s, ws * r
                total += w * r * r
                sum_w += w
                sum_r += w * r
                sum_s += ws
                sum_ss += wss
                sum_rs += wsr
                grad[k] += wsr
                hess[0, k] += ws
                hess[k, k] += wss
                hess[_D + i, k] += wss
                hess[_F + t, k] += wss
            grad[0] += sum_r
            hess[0, 0] += sum_w
            grad[_D + i] += sum_rs
            grad[_F + t] += sum_rs
            hess[0, _D + i] += sum_s
            hess[0, _F + t] += sum_s
            hess[_D + i, _D + i] += sum_ss
            hess[_F + t, _F + t] += sum_ss
            hess[_D + i, _F + t] = sum_ss
    for a in range(SIZE):
        for b in range(a):
            hess[a, b] = hess[b, a]
    return total
