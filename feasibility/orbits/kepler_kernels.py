"""Kepler propagation, with and without the state-transition matrix, for any conic.

Universal variables throughout, so that ellipses, parabolas, hyperbolas and
rectilinear orbits take the same path and nothing is singular at e = 0 or
e = 1. With s the universal anomaly (ds = dt / r) and beta = 2 mu / r - v^2, the
G-functions G_k(s) = s^k c_k(beta s^2) are Stumpff's (Stumpff 1959; the notation
is that of Wisdom and Hernandez 2015, "A fast and accurate universal Kepler
solver without Stumpff series", section 2):

    dt = r0 G1 + eta0 G2 + mu G3          (Kepler's equation, eta0 = r0 . v0)
    r  = r0 G0 + eta0 G1 + mu G2          (its derivative with respect to s)

The state-transition matrix is Battin's closed form (Battin 1999, "An
Introduction to the Mathematics and Methods of Astrodynamics", section 9.7,
equations 9.84 to 9.87).

Kernels: arrays must be contiguous float64; nothing is validated; nothing is
allocated except by the `_batch` functions.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel

_Array = NDArray[np.float64]

_TWO_PI = 2.0 * math.pi
_MAX_ITERATIONS = 100
_EPS = 2.220446049250313e-16
# Below this |beta s^2| the closed forms of G2 and G3 lose digits, and the series wins.
_SERIES_LIMIT = 1.0


@inner_kernel
def g_functions(s: float, beta: float) -> tuple[float, float, float]:
    """Return G1, G2, G3 at the universal anomaly `s`.

    G1 = s c1, G2 = s^2 c2, G3 = s^3 c3 with Stumpff's c_k(beta s^2): by their
    power series for small arguments, by circular and hyperbolic functions
    otherwise.
    """
    z = beta * s * s
    if abs(z) < _SERIES_LIMIT:
        c3 = 1.0 - z / 342.0
        c3 = 1.0 - z / 272.0 * c3
        c3 = 1.0 - z / 210.0 * c3
        c3 = 1.0 - z / 156.0 * c3
        c3 = 1.0 - z / 110.0 * c3
        c3 = 1.0 - z / 72.0 * c3
        c3 = 1.0 - z / 42.0 * c3
        c3 = (1.0 - z / 20.0 * c3) / 6.0
        c2 = 1.0 - z / 306.0
        c2 = 1.0 - z / 240.0 * c2
        c2 = 1.0 - z / 182.0 * c2
        c2 = 1.0 - z / 132.0 * c2
        c2 = 1.0 - z / 90.0 * c2
        c2 = 1.0 - z / 56.0 * c2
        c2 = 1.0 - z / 30.0 * c2
        c2 = (1.0 - z / 12.0 * c2) / 2.0
        return s * (1.0 - z * c3), s * s * c2, s * s * s * c3
    if beta > 0.0:
        k = math.sqrt(beta)
        x = k * s
        sine = math.sin(x)
        half = math.sin(0.5 * x)
        return sine / k, 2.0 * half * half / beta, (x - sine) / (k * beta)
    k = math.sqrt(-beta)
    x = k * s
    sine = math.sinh(x)
    half = math.sinh(0.5 * x)
    return sine / k, -2.0 * half * half / beta, (x - sine) / (k * beta)


@inner_kernel
def _first_guess(dt: float, r0: float, eta0: float, beta: float, mu: float) -> float:
    """Return a first universal anomaly for 0 <= dt, at most half a period."""
    tau = dt / r0
    a = 0.5 * eta0 / r0
    b = (mu - beta * r0) / (6.0 * r0)
    if abs(a * tau) < 0.2 and abs(b) * tau * tau < 0.2:
        # Inverse of the Taylor series of Kepler's equation: ample for short arcs.
        return tau * (1.0 - a * tau + (2.0 * a * a - b) * tau * tau)
    if beta > 0.0:
        # Danby 1987, "The solution of Kepler's equation, III", with 0.85 e.
        k = math.sqrt(beta)
        e_cos = 1.0 - r0 * beta / mu
        e_sin = eta0 * k / mu
        y = dt * beta * k / mu - e_sin
        sigma = e_cos * math.sin(y) + e_sin * math.cos(y)
        e = math.sqrt(e_cos * e_cos + e_sin * e_sin)
        return (y + math.copysign(0.85 * e, sigma)) / k
    guess = min(tau, float(np.cbrt(6.0 * dt / mu)))
    if beta < 0.0:
        # Hyperbolic anomalies at both ends, the final one by the logarithm that bounds it;
        # without it an inbound hyperbola starts far beyond the solution and overflows.
        k = math.sqrt(-beta)
        e_cosh = 1.0 - r0 * beta / mu
        e_sinh = eta0 * k / mu
        inward = max(e_cosh - e_sinh, _EPS * e_cosh)
        outward = max(e_cosh + e_sinh, _EPS * e_cosh)
        e = math.sqrt(inward * outward)
        anomaly = 0.5 * math.log(outward / inward)
        mean = e_sinh - anomaly - dt * beta * k / mu
        final = math.copysign(math.log(2.0 * abs(mean) / e + 1.8), mean)
        guess = max(final - anomaly, 0.01 * k * guess) / k
    return guess


@inner_kernel
def solve_kepler(
    dt: float, r0: float, eta0: float, beta: float, mu: float
) -> tuple[float, float, float, float, float]:
    """Return s, G1, G2, G3, turns with dt = r0 G1 + eta0 G2 + mu G3 for any conic and any dt.

    The right-hand side increases with s, so Laguerre's iteration (Conway 1986,
    "An improved algorithm due to Laguerre for the solution of Kepler's
    equation") is kept inside a shrinking bracket and cannot fail. For several
    revolutions G1, G2 and G3 are those of the last, incomplete one; `s` is the
    whole anomaly, and `turns` what is missing in G3, 2 pi k / beta^1.5.
    """
    whole_turns = 0.0
    turns = 0.0
    if beta > 0.0:
        period = _TWO_PI * mu / (beta * math.sqrt(beta))
        whole_turns = np.rint(dt / period)
        dt = dt - whole_turns * period
    # Backward motion is forward motion from the mirrored velocity.
    sign = 1.0
    if dt < 0.0:
        sign = -1.0
        dt = -dt
        eta0 = -eta0
    low = 0.0
    high = _TWO_PI / math.sqrt(beta) if beta > 0.0 else np.inf
    zeta = mu - beta * r0
    s = _first_guess(dt, r0, eta0, beta, mu)
    if not (low < s < high):
        s = 0.5 * high if high < np.inf else dt / r0
    g1 = 0.0
    g2 = 0.0
    g3 = 0.0
    for _ in range(_MAX_ITERATIONS):
        g1, g2, g3 = g_functions(s, beta)
        gap = r0 * g1 + eta0 * g2 + mu * g3 - dt
        if abs(gap) <= _EPS * dt:
            break
        if gap > 0.0:
            high = s
        elif gap < 0.0:
            low = s
        else:
            # Overflow of the hyperbolic functions: s is much too large.
            high = s
            s = 0.5 * (low + high)
            continue
        slope = r0 + eta0 * g1 + zeta * g2
        curvature = eta0 * (1.0 - beta * g2) + zeta * g1
        root = math.sqrt(abs(4.0 * slope * slope - 5.0 * gap * curvature))
        previous = s
        s = s - 5.0 * gap / (slope + 2.0 * root)
        if not (low < s < high):
            s = 0.5 * (low + high) if high < np.inf else 2.0 * previous
        if abs(s - previous) <= 2.0 * _EPS * s or low >= high * (1.0 - 2.0 * _EPS):
            g1, g2, g3 = g_functions(s, beta)
            break
    s = sign * s
    if whole_turns != 0.0:
        root = math.sqrt(beta)
        s += whole_turns * _TWO_PI / root
        turns = whole_turns * _TWO_PI / (beta * root)
    return s, sign * g1, g2, sign * g3, turns


@inner_kernel
def kepler_secular(s: float, g2: float, g3: float, turns: float, beta: float) -> float:
    """Return 3 G5 - s G4 over all revolutions: by a series where the closed form loses digits."""
    z = beta * s * s
    if abs(z) < _SERIES_LIMIT:
        term = s * s * s * s * s / 120.0
        secular = -2.0 * term
        for k in range(1, 9):
            term *= -z / ((2 * k + 4) * (2 * k + 5))
            secular -= (2 * k + 2) * term
        return secular
    return (s * g2 - 3.0 * (g3 + turns)) / beta


@kernel
def propagate(rv: _Array, dt: float, mu: float, out: _Array) -> None:
    """Write the state after `dt` of Keplerian motion.

    Parameters
    ----------
    rv : (6,) float64, m and m/s
        State; not changed unless it is also `out`.
    dt : float, s
        Of either sign, any number of revolutions.
    mu : float, m3/s2
    out : (6,) float64, m and m/s
        Receives the final state; may be `rv` itself.
    """
    x, y, z = rv[0], rv[1], rv[2]
    vx, vy, vz = rv[3], rv[4], rv[5]
    r0 = math.sqrt(x * x + y * y + z * z)
    eta0 = x * vx + y * vy + z * vz
    beta = 2.0 * mu / r0 - (vx * vx + vy * vy + vz * vz)
    _, g1, g2, _, _ = solve_kepler(dt, r0, eta0, beta, mu)
    f = 1.0 - mu * g2 / r0
    g = r0 * g1 + eta0 * g2
    out[0] = f * x + g * vx
    out[1] = f * y + g * vy
    out[2] = f * z + g * vz
    r = math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    ft = -mu * g1 / (r * r0)
    gt = 1.0 - mu * g2 / r
    out[3] = ft * x + gt * vx
    out[4] = ft * y + gt * vy
    out[5] = ft * z + gt * vz


@kernel
def propagate_stm(rv: _Array, dt: float, mu: float, out: _Array, stm: _Array) -> None:
    """Write the state after `dt` of Keplerian motion and its derivative.

    Parameters
    ----------
    rv : (6,) float64, m and m/s
        State; not changed unless it is also `out`.
    dt : float, s
        Of either sign, any number of revolutions.
    mu : float, m3/s2
    out : (6,) float64, m and m/s
        Receives the final state; may be `rv` itself.
    stm : (6, 6) float64
        Receives d(out) / d(rv), rows by final state, SI.
    """
    p0 = (rv[0], rv[1], rv[2])
    v0 = (rv[3], rv[4], rv[5])
    r0 = math.sqrt(p0[0] * p0[0] + p0[1] * p0[1] + p0[2] * p0[2])
    eta0 = p0[0] * v0[0] + p0[1] * v0[1] + p0[2] * v0[2]
    beta = 2.0 * mu / r0 - (v0[0] * v0[0] + v0[1] * v0[1] + v0[2] * v0[2])
    s, g1, g2, g3, turns = solve_kepler(dt, r0, eta0, beta, mu)
    secular = kepler_secular(s, g2, g3, turns, beta)
    c = mu * (mu * secular - dt * g2)
    one_f = mu * g2 / r0
    f = 1.0 - one_f
    g = r0 * g1 + eta0 * g2
    p = (f * p0[0] + g * v0[0], f * p0[1] + g * v0[1], f * p0[2] + g * v0[2])
    r = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
    ft = -mu * g1 / (r * r0)
    one_gt = mu * g2 / r
    gt = 1.0 - one_gt
    dv = (
        ft * p0[0] - one_gt * v0[0],
        ft * p0[1] - one_gt * v0[1],
        ft * p0[2] - one_gt * v0[2],
    )
    v = (ft * p0[0] + gt * v0[0], ft * p0[1] + gt * v0[1], ft * p0[2] + gt * v0[2])
    eta = p[0] * v[0] + p[1] * v[1] + p[2] * v[2]
    r2 = r * r
    r02 = r0 * r0
    for i in range(3):
        w = p[i] * eta - v[i] * r2
        # Coefficients of the row vectors r0, v0, r, v - v0, so that each entry is short.
        rr_p0 = (r0 * one_f * p[i] + c * v[i]) / (r0 * r02)
        rr_dv = r * dv[i] / mu
        rv_v0 = (r0 * one_f * (p[i] - p0[i]) + c * v[i]) / mu
        rv_p0 = -r0 * one_f * dv[i] / mu
        for j in range(3):
            stm[i, j] = rr_dv * dv[j] + rr_p0 * p0[j]
            stm[i, 3 + j] = rv_v0 * v0[j] + rv_p0 * p0[j]
        stm[i, i] += f
        stm[i, 3 + i] += g
        vr_p0 = -dv[i] / r02 - mu * c * p[i] / (r * r2 * r0 * r02)
        vr_dv = -p[i] / r2 + ft * w / (mu * r)
        vr_p = -ft * p[i] / r2
        vv_p0 = r0 * one_f * p[i] / (r * r2)
        vv_v0 = -c * p[i] / (r * r2)
        vv_dv = r0 * dv[i] / mu
        for j in range(3):
            stm[3 + i, j] = vr_p0 * p0[j] + vr_dv * dv[j] + vr_p * p[j]
            stm[3 + i, 3 + j] = vv_dv * dv[j] + vv_p0 * p0[j] + vv_v0 * v0[j]
        stm[3 + i, i] += ft
        stm[3 + i, 3 + i] += gt
    for i in range(3):
        out[i] = p[i]
        out[3 + i] = v[i]


@kernel
def propagate_batch(rv: _Array, dt: _Array, mu: float) -> _Array:
    """Return (n, 6) states after `dt` (n,) s of Keplerian motion from `rv` (n, 6)."""
    n = rv.shape[0]
    out = np.empty((n, 6))
    for i in range(n):
        propagate(rv[i], dt[i], mu, out[i])
    return out


@kernel
def propagate_stm_batch(rv: _Array, dt: _Array, mu: float) -> tuple[_Array, _Array]:
    """Return (n, 6) states and (n, 6, 6) state-transition matrices; see `propagate_stm`."""
    n = rv.shape[0]
    out = np.empty((n, 6))
    stm = np.empty((n, 6, 6))
    for i in range(n):
        propagate_stm(rv[i], dt[i], mu, out[i], stm[i])
    return out, stm
