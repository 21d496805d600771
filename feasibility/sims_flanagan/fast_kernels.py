"""Building blocks of the fast leg solvers: elements, mass profile, linearised arc, dual.

Everything here is scaled: mu = 1, lengths in units of the departure radius.
Kernels work on one leg, on preallocated contiguous float64 arrays.

A leg of s segments is a chain of Kepler arcs with an impulse dv_i at the centre
of each segment (Sims and Flanagan 1999, "Preliminary design of low-thrust
interplanetary missions"). The arc is shot forward from the departure state and
its end compared with the target in equinoctial elements with the mean longitude
(n, e cos, e sin, h, k, l): under Kepler motion only l changes, linearly, so the
map from impulses to this gap is much closer to linear than in Cartesian
coordinates, and a whole revolution more or less is 2 pi in one component.
"""

import math

import numpy as np

from feasibility.jit import kernel
from feasibility.orbits.kepler_kernels import propagate, propagate_stm

_TWO_PI = 2.0 * math.pi
_STEP = 1e-5
_DUAL_ITERATIONS = 40


@kernel
def cholesky(a, lower):
    """Write the lower Cholesky factor of the (6, 6) matrix `a`; return whether it exists."""
    for i in range(6):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                lower[i, i] = math.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    return True


@kernel
def solve_lower(lower, b):
    """Overwrite `b` (6,) with the solution of L x = b."""
    for i in range(6):
        total = b[i]
        for k in range(i):
            total -= lower[i, k] * b[k]
        b[i] = total / lower[i, i]


@kernel
def solve_lower_transposed(lower, b):
    """Overwrite `b` (6,) with the solution of L^T x = b."""
    for i in range(5, -1, -1):
        total = b[i]
        for k in range(i + 1, 6):
            total -= lower[k, i] * b[k]
        b[i] = total / lower[i, i]


@kernel
def to_elements(x, e):
    """Write the elements (n, ex, ey, h, k, l) of the state `x`; return False if not elliptic.

    Equinoctial elements (Broucke and Cefola 1972) with the mean motion n in
    place of the semi-major axis; h + ik = tan(i/2) exp(i node).
    """
    r = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    hx = x[1] * x[5] - x[2] * x[4]
    hy = x[2] * x[3] - x[0] * x[5]
    hz = x[0] * x[4] - x[1] * x[3]
    hh = math.sqrt(hx * hx + hy * hy + hz * hz)
    alpha = 2.0 / r - (x[3] * x[3] + x[4] * x[4] + x[5] * x[5])
    if not alpha > 1e-6 or not hh + hz > 1e-6 * hh:
        return False
    a = 1.0 / alpha
    h = -hy / (hh + hz)
    k = hx / (hh + hz)
    s2 = 1.0 + h * h + k * k
    f0 = (1.0 + h * h - k * k) / s2
    f1 = 2.0 * h * k / s2
    f2 = -2.0 * k / s2
    g1 = (1.0 - h * h + k * k) / s2
    g2 = 2.0 * h / s2
    ecx = x[4] * hz - x[5] * hy - x[0] / r
    ecy = x[5] * hx - x[3] * hz - x[1] / r
    ecz = x[3] * hy - x[4] * hx - x[2] / r
    ex = ecx * f0 + ecy * f1 + ecz * f2
    ey = ecx * f1 + ecy * g1 + ecz * g2
    px = x[0] * f0 + x[1] * f1 + x[2] * f2
    py = x[0] * f1 + x[1] * g1 + x[2] * g2
    eta2 = 1.0 - ex * ex - ey * ey
    if not eta2 > 1e-10:
        return False
    eta = math.sqrt(eta2)
    b = 1.0 / (1.0 + eta)
    cos_f = ex + ((1.0 - ex * ex * b) * px - ex * ey * b * py) / (a * eta)
    sin_f = ey + ((1.0 - ey * ey * b) * py - ex * ey * b * px) / (a * eta)
    e[0] = alpha * math.sqrt(alpha)
    e[1] = ex
    e[2] = ey
    e[3] = h
    e[4] = k
    e[5] = math.atan2(sin_f, cos_f) - ex * sin_f + ey * cos_f
    return True


@kernel
def from_elements(e, x):
    """Write the state of the elements (n, ex, ey, h, k, l)."""
    ex, ey, h, k = e[1], e[2], e[3], e[4]
    f = e[5]
    for _ in range(20):
        s = math.sin(f)
        c = math.cos(f)
        step = (e[5] - f - ey * c + ex * s) / (1.0 - ex * c - ey * s)
        f += min(1.0, max(-1.0, step))
        if abs(step) < 1e-13 * (1.0 + abs(f)):
            break
    s = math.sin(f)
    c = math.cos(f)
    a = e[0] ** (-2.0 / 3.0)
    b = 1.0 / (1.0 + math.sqrt(1.0 - ex * ex - ey * ey))
    na_r = e[0] * a / (1.0 - ex * c - ey * s)
    px = a * ((1.0 - ey * ey * b) * c + ex * ey * b * s - ex)
    py = a * ((1.0 - ex * ex * b) * s + ex * ey * b * c - ey)
    vx = na_r * (ex * ey * b * c - (1.0 - ey * ey * b) * s)
    vy = na_r * ((1.0 - ex * ex * b) * c - ex * ey * b * s)
    s2 = 1.0 + h * h + k * k
    f0 = (1.0 + h * h - k * k) / s2
    f1 = 2.0 * h * k / s2
    f2 = -2.0 * k / s2
    g1 = (1.0 - h * h + k * k) / s2
    g2 = 2.0 * h / s2
    x[0] = px * f0 + py * f1
    x[1] = px * f1 + py * g1
    x[2] = px * f2 + py * g2
    x[3] = vx * f0 + vy * f1
    x[4] = vx * f1 + vy * g1
    x[5] = vx * f2 + vy * g2


@kernel
def wrap(angle):
    """Return the angle moved by whole turns into [-pi, pi]."""
    return angle - _TWO_PI * np.rint(angle / _TWO_PI)


@kernel
def element_gap(x, target, gap):
    """Write elements of `x` minus `target`, longitude wrapped; return False if not elliptic."""
    if not to_elements(x, gap):
        return False
    for i in range(6):
        gap[i] -= target[i]
    gap[5] = wrap(gap[5])
    return True


@kernel
def element_derivatives(x, first, columns, plus, minus, shifted):
    """Write d(elements)/d(x) for components `first`.. into columns 0.. of `columns` (6, >= 6-first).

    Central differences: their error of 1e-10 only slows a Newton iteration.
    """
    for i in range(6):
        shifted[i] = x[i]
    for j in range(first, 6):
        shifted[j] = x[j] + _STEP
        if not to_elements(shifted, plus):
            return False
        shifted[j] = x[j] - _STEP
        if not to_elements(shifted, minus):
            return False
        shifted[j] = x[j]
        for i in range(5):
            columns[i, j - first] = (plus[i] - minus[i]) / (2.0 * _STEP)
        columns[5, j - first] = wrap(plus[5] - minus[5]) / (2.0 * _STEP)
    return True


@kernel
def full_thrust_profile(z, n, n_forward, y, slope):
    """Write impulses over exhaust velocity, y_i, at full thrust, and their derivative by z.

    z = T dt / (m0 c). Forward half (mass before the impulse): y = z_i; backward
    half (mass after it): y exp(-y) = z_i; both z_(i+1) = z_i exp(y_i). Returns
    False where a backward segment would need more than the whole mass (z_i > 1/e).
    """
    zi = z
    dz = 1.0
    for i in range(n):
        if i < n_forward:
            y[i] = zi
            slope[i] = dz
            grow = math.exp(zi)
            dz = dz * grow * (1.0 + zi)
            zi = zi * grow
            if not zi < 10.0:
                return False
        else:
            if zi > 0.36:
                return False
            yi = zi * (1.0 + zi * (1.0 + 1.5 * zi))
            grow = math.exp(yi)
            for _ in range(20):
                step = (yi - zi * grow) / (1.0 - yi)
                yi -= step
                grow = math.exp(yi)
                if abs(step) < 1e-15:
                    break
            dz = dz * grow / (1.0 - yi)
            y[i] = yi
            slope[i] = dz
            zi = yi
    return True


@kernel
def z_of_impulses(dv, n, n_forward, c):
    """Return the smallest z = T dt / (m0 c) at which the impulses need no throttle above 1.

    m0 exp(-S_i / c) |dv_i| <= T dt with S_i the sum of the impulses before
    segment i, in the backward half including it.
    """
    total = 0.0
    z = 0.0
    for i in range(n):
        y = math.sqrt(dv[i, 0] ** 2 + dv[i, 1] ** 2 + dv[i, 2] ** 2) / c
        if i < n_forward:
            z = max(z, y * math.exp(-total))
            total += y
        else:
            total += y
            z = max(z, y * math.exp(-total))
    return z


@kernel
def shoot(x0, dv, n, dt, x):
    """Write into `x` the end of the arc from `x0` with the impulses `dv`."""
    propagate(x0, 0.5 * dt, 1.0, x)
    for i in range(n):
        x[3] += dv[i, 0]
        x[4] += dv[i, 1]
        x[5] += dv[i, 2]
        propagate(x, dt if i < n - 1 else 0.5 * dt, 1.0, x)


@kernel
def shoot_stm(x0, dv, n, dt, x, stm):
    """As `shoot`; also writes the transition matrix (n, 6, 6) of each arc after an impulse."""
    propagate(x0, 0.5 * dt, 1.0, x)
    for i in range(n):
        x[3] += dv[i, 0]
        x[4] += dv[i, 1]
        x[5] += dv[i, 2]
        propagate_stm(x, dt if i < n - 1 else 0.5 * dt, 1.0, x, stm[i])


@kernel
def whiten(b, n, gram, lower):
    """Overwrite each b_i (6, 3) with L^-1 b_i, where L L^T = sum b_i b_i^T; return whether it can.

    In whitened coordinates the norm of a gap is the least impulse that closes it.
    """
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += (
                    b[k, i, 0] * b[k, j, 0] + b[k, i, 1] * b[k, j, 1] + b[k, i, 2] * b[k, j, 2]
                )
            gram[i, j] = total
    if not cholesky(gram, lower):
        return False
    for k in range(n):
        for col in range(3):
            for i in range(6):
                total = b[k, i, col]
                for j in range(i):
                    total -= lower[i, j] * b[k, j, col]
                b[k, i, col] = total / lower[i, i]
    return True


@kernel
def sensitivities(stm, end_jacobian, n, b, m, m_next):
    """Write b_i (6, 3) = d(end elements)/d(dv_i) from the arcs' matrices, last arc first."""
    for i in range(6):
        for j in range(6):
            m[i, j] = end_jacobian[i, j]
    for k in range(n - 1, -1, -1):
        for i in range(6):
            for j in range(6):
                total = 0.0
                for col in range(6):
                    total += m[i, col] * stm[k, col, j]
                m_next[i, j] = total
        for i in range(6):
            for j in range(6):
                m[i, j] = m_next[i, j]
            for j in range(3):
                b[k, i, j] = m[i, 3 + j]


@kernel
def _primers(b, lam, n, primer, norm):
    for i in range(n):
        total = 0.0
        for j in range(3):
            p = 0.0
            for k in range(6):
                p += b[i, k, j] * lam[k]
            primer[i, j] = p
            total += p * p
        norm[i] = math.sqrt(total)


@kernel
def _bound(norm, work, z, n, n_forward, c, y, slope):
    """Return the z at which full thrust along the primers just does `work`: c sum y_i |p_i|."""
    for _ in range(30):
        if not full_thrust_profile(z, n, n_forward, y, slope):
            z *= 0.5
            continue
        done = 0.0
        rate = 0.0
        for i in range(n):
            done += c * y[i] * norm[i]
            rate += c * slope[i] * norm[i]
        step = (work - done) / rate
        z += max(step, -0.5 * z)
        if abs(step) < 1e-10 * z:
            break
    if full_thrust_profile(z, n, n_forward, y, slope):
        return z
    return -1.0


@kernel
def least_thrust(b, gap, n, n_forward, c, lam, z, dv, scratch):
    """Solve: least z with sum b_i dv_i = gap and |dv_i| <= c y_i(z); write dv; return z or -1.

    The dual is the largest z(lam) over 6-vectors lam, where z(lam) solves
    c sum y_i(z) |b_i^T lam| = lam . gap: damped Newton on lam. `b` and `gap` are
    whitened; `lam` holds the first guess and receives the solution, norm 1.
    """
    primer, norm, trial_primer, trial_norm, y, slope, h, lower, grad, step, trial = scratch
    if not z > 0.0:
        z = 1e-3
    work = 0.0
    for i in range(6):
        work += lam[i] * gap[i]
    if not work > 0.0:
        for i in range(6):
            lam[i] = gap[i]
    size = 0.0
    for i in range(6):
        size += lam[i] * lam[i]
    size = math.sqrt(size)
    if not size > 0.0:
        return -1.0
    work = 0.0
    for i in range(6):
        lam[i] /= size
        work += lam[i] * gap[i]
    _primers(b, lam, n, primer, norm)
    z = _bound(norm, work, z, n, n_forward, c, y, slope)
    if not z > 0.0:
        return -1.0
    for _ in range(_DUAL_ITERATIONS):
        mean = 0.0
        for i in range(n):
            mean += norm[i]
        eps2 = (1e-4 * mean / n) ** 2
        for i in range(6):
            grad[i] = -gap[i]
            for j in range(i + 1):
                h[i, j] = 0.0
        for k in range(n):
            soft = 1.0 / math.sqrt(norm[k] * norm[k] + eps2)
            w = c * y[k] * soft
            p0 = primer[k, 0] * soft
            p1 = primer[k, 1] * soft
            p2 = primer[k, 2] * soft
            for i in range(6):
                along = b[k, i, 0] * p0 + b[k, i, 1] * p1 + b[k, i, 2] * p2
                step[i] = along
                grad[i] += c * y[k] * along
                for j in range(i + 1):
                    h[i, j] += w * (
                        b[k, i, 0] * b[k, j, 0]
                        + b[k, i, 1] * b[k, j, 1]
                        + b[k, i, 2] * b[k, j, 2]
                        - along * step[j]
                    )
        trace = 0.0
        for i in range(6):
            trace += h[i, i]
        # The Hessian has no curvature along lam, whose length is free.
        for i in range(6):
            for j in range(i + 1):
                h[i, j] += trace * lam[i] * lam[j]
            h[i, i] += 1e-12 * trace
        if not cholesky(h, lower):
            return -1.0
        for i in range(6):
            step[i] = -grad[i]
        solve_lower(lower, step)
        solve_lower_transposed(lower, step)
        decrement = 0.0
        for i in range(6):
            decrement -= step[i] * grad[i]
        if not decrement > 1e-9 * work:
            break
        fraction = 1.0
        better = False
        for _ in range(12):
            size = 0.0
            for i in range(6):
                trial[i] = lam[i] + fraction * step[i]
                size += trial[i] * trial[i]
            size = math.sqrt(size)
            trial_work = 0.0
            for i in range(6):
                trial[i] /= size
                trial_work += trial[i] * gap[i]
            if trial_work > 0.0:
                _primers(b, trial, n, trial_primer, trial_norm)
                trial_z = _bound(trial_norm, trial_work, z, n, n_forward, c, y, slope)
                if trial_z > z:
                    better = True
                    break
            fraction *= 0.5
        if not better:
            break
        z = trial_z
        work = trial_work
        for i in range(6):
            lam[i] = trial[i]
        for i in range(n):
            norm[i] = trial_norm[i]
            for j in range(3):
                primer[i, j] = trial_primer[i, j]
    if not full_thrust_profile(z, n, n_forward, y, slope):
        return -1.0
    for i in range(n):
        scale = c * y[i] / max(norm[i], 1e-300)
        for j in range(3):
            dv[i, j] = scale * primer[i, j]
    return z
