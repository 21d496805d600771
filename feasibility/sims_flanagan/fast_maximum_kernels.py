"""Maximum initial mass of one leg by sequential linearisation: kernels."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feasibility.jit import kernel
from feasibility.orbits.kepler_kernels import propagate
from feasibility.sims_flanagan.fast_kernels import (
    element_derivatives,
    element_gap,
    from_elements,
    least_thrust,
    sensitivities,
    shoot,
    shoot_stm,
    solve_lower,
    solve_lower_transposed,
    to_elements,
    whiten,
    wrap,
    z_of_impulses,
)

_TWO_PI = 2.0 * math.pi
N_STARTS = 5


class Workspace(NamedTuple):
    b: NDArray[np.float64]
    stm: NDArray[np.float64]
    m: NDArray[np.float64]
    m_next: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    lower: NDArray[np.float64]
    x: NDArray[np.float64]
    e: NDArray[np.float64]
    v6: NDArray[np.float64]
    dv: NDArray[np.float64]
    trial: NDArray[np.float64]
    linear: NDArray[np.float64]
    starts: NDArray[np.float64]
    start_z: NDArray[np.float64]
    start_longitude: NDArray[np.float64]
    start_lam: NDArray[np.float64]
    start_nodes: NDArray[np.float64]
    jumps: NDArray[np.float64]
    moved: NDArray[np.float64]
    response: NDArray[np.float64]
    pinned: NDArray[np.bool_]
    dual: tuple[NDArray[np.float64], ...]


@kernel
def make_workspace(n):
    dual = (
        np.empty((n, 3)),
        np.empty(n),
        np.empty((n, 3)),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty((6, 6)),
        np.empty((6, 6)),
        np.empty((n, 3)),
        np.empty((6, 6)),
    )
    return Workspace(
        np.empty((n, 6, 3)),
        np.empty((n, 6, 6)),
        np.empty((6, 6)),
        np.empty((6, 6)),
        np.empty((6, 6)),
        np.empty((6, 6)),
        np.empty(6),
        np.empty((4, 6)),
        np.empty((8, 6)),
        np.empty((n, 3)),
        np.empty((n, 3)),
        np.empty((n, 3)),
        np.empty((N_STARTS, n, 3)),
        np.empty(N_STARTS),
        np.empty(N_STARTS),
        np.empty((N_STARTS, 6)),
        np.empty((N_STARTS, n, 6)),
        np.empty((n, 6)),
        np.empty((n, 6)),
        np.empty((n, 6, 3)),
        np.empty(n, dtype=np.bool_),
        dual,
    )


@kernel
def linearise(x0, dv, n, dt, target, w, gap):
    """Write whitened sensitivities and the whitened gap; return its norm, inf where it fails."""
    shoot_stm(x0, dv, n, dt, w.x, w.stm)
    if not element_gap(w.x, target, gap):
        return np.inf
    if not element_derivatives(w.x, 0, w.jacobian, w.e[0], w.e[1], w.e[2]):
        return np.inf
    sensitivities(w.stm, w.jacobian, n, w.b, w.m, w.m_next)
    if not whiten(w.b, n, w.m, w.lower):
        return np.inf
    solve_lower(w.lower, gap)
    return norm6(gap)


@kernel
def norm6(a):
    total = 0.0
    for i in range(6):
        total += a[i] * a[i]
    return math.sqrt(total)


@kernel
def subtract(b, gap, fraction, n, dv):
    """dv -= fraction * (least-norm impulses with sum b_i dv_i = gap)."""
    for i in range(n):
        for j in range(3):
            total = 0.0
            for k in range(6):
                total += b[i, k, j] * gap[k]
            dv[i, j] -= fraction * total


@kernel
def whitened_gap(x0, dv, n, dt, target, w, gap):
    shoot(x0, dv, n, dt, w.x)
    if not element_gap(w.x, target, gap):
        return np.inf
    solve_lower(w.lower, gap)
    return norm6(gap)


@kernel
def close(x0, dv, n, dt, target, tolerance, iterations, w):
    """Close the arc by least-norm Gauss-Newton corrections; return whether it closed."""
    gap = w.v6[0]
    trial_gap = w.v6[1]
    for _ in range(iterations):
        size = linearise(x0, dv, n, dt, target, w, gap)
        if not size < np.inf:
            return False
        if size < tolerance:
            return True
        fraction = 1.0
        accepted = False
        for _ in range(6):
            for i in range(n):
                for j in range(3):
                    w.trial[i, j] = dv[i, j]
            subtract(w.b, gap, fraction, n, w.trial)
            trial_size = whitened_gap(x0, w.trial, n, dt, target, w, trial_gap)
            if trial_size < (1.0 - 0.3 * fraction) * size or trial_size < tolerance:
                accepted = True
                break
            fraction *= 0.4
        if not accepted:
            return False
        for i in range(n):
            for j in range(3):
                dv[i, j] = w.trial[i, j]
        if trial_size < tolerance:
            return True
    return False


@kernel
def restore(x0, dv, n, dt, target, tolerance, w):
    """As `close` with the sensitivities at hand; gives up where it does not contract."""
    gap = w.v6[1]
    size = whitened_gap(x0, dv, n, dt, target, w, gap)
    for _ in range(8):
        if size < tolerance:
            return True
        if not size < np.inf:
            return False
        subtract(w.b, gap, 1.0, n, dv)
        new_size = whitened_gap(x0, dv, n, dt, target, w, gap)
        if not new_size < 0.5 * size and not new_size < tolerance:
            return False
        size = new_size
    return size < tolerance


@kernel
def improve(x0, dv, n, n_forward, dt, c, target, iterations, gain_tolerance, z_stop, lam, w, info):
    """Lower z of the closed arc `dv`; return its z (dv stays closed)."""
    gap = w.v6[0]
    work = w.v6[2]
    z = z_of_impulses(dv, n, n_forward, c)
    fraction = 1.0
    for it in range(iterations):
        info[0] += 1
        size = linearise(x0, dv, n, dt, target, w, gap)
        if not size < np.inf:
            break
        for i in range(6):
            total = -gap[i]
            for k in range(n):
                for j in range(3):
                    total += w.b[k, i, j] * dv[k, j]
            work[i] = total
        # lam lives in element coordinates between linearisations.
        whiten_costate(w.lower, lam)
        z_linear = least_thrust(
            w.b, work, n, n_forward, c, lam, z, dv, w.linear, w.pinned, w.dual, info
        )
        solve_lower_transposed(w.lower, lam)
        if not z_linear > 0.0:
            break
        gain = math.log(z / z_linear)
        info[1] = gain
        if gain < gain_tolerance:
            break
        accepted = False
        for _ in range(10):
            info[2] += 1
            for i in range(n):
                for j in range(3):
                    w.trial[i, j] = dv[i, j] + fraction * (w.linear[i, j] - dv[i, j])
            if restore(x0, w.trial, n, dt, target, 1e-9, w):
                trial_z = z_of_impulses(w.trial, n, n_forward, c)
                if math.log(z / trial_z) > 0.1 * fraction * gain:
                    accepted = True
                    break
            fraction *= 0.5
        if not accepted:
            break
        for i in range(n):
            for j in range(3):
                dv[i, j] = w.trial[i, j]
        z = trial_z
        fraction = min(1.0, 2.0 * fraction)
    return z


@kernel
def whiten_costate(lower, lam):
    """lam <- L^T lam."""
    for i in range(6):
        total = 0.0
        for k in range(i, 6):
            total += lower[k, i] * lam[k]
        lam[i] = total


@kernel
def drift(e, dt):
    """Move elements along their Kepler orbit."""
    e[5] += e[0] * dt


@kernel
def draw_path(e0, e1, tof, turns, n, nodes):
    """Draw the elements before each impulse along a path with a number of turns.

    Linear in time, the mean motion with a parabola on top that makes the mean
    longitude arrive after the wanted number of turns. Returns the mean longitude
    at arrival, NaN where the path would need an absurd mean motion.
    """
    mean_motion = 0.5 * (e0[0] + e1[0])
    travel = mean_motion * tof + wrap(e1[5] - e0[5] - mean_motion * tof) + _TWO_PI * turns
    bump = travel / tof - mean_motion
    low = min(e0[0], e1[0])
    high = max(e0[0], e1[0])
    if turns != 0 and not mean_motion + 1.5 * bump > 0.2 * low:
        return np.nan
    for i in range(n):
        t = (i + 0.5) / n
        for j in range(1, 5):
            nodes[i, j] = e0[j] + t * (e1[j] - e0[j])
        motion = e0[0] + t * (e1[0] - e0[0]) + 6.0 * bump * t * (1.0 - t)
        nodes[i, 0] = min(max(motion, 0.5 * low), 2.0 * high)
        nodes[i, 5] = e0[5] + tof * (
            e0[0] * t + 0.5 * (e1[0] - e0[0]) * t * t + bump * t * t * (3.0 - 2.0 * t)
        )
    return e0[5] + travel


@kernel
def lifted_sweep(e0, e1, longitude, dt, n, n_forward, c, first, nodes, dv, z, lam, w, info):
    """Bend a path of nodes and its impulses towards a true arc of least thrust.

    One lifted Newton step: every node is an unknown of its own, condensed to the
    impulses; in elements the coasts between nodes are exactly linear. Returns the
    new z, -1 where the step fails, and the largest move of a node, inf where the step
    had to be shortened.
    """
    jumps, response, moved = w.jumps, w.response, w.moved
    gap = w.v6[0]
    total = w.v6[2]
    work = w.v6[3]
    # Jump of each node, its derivatives by the impulse and by the node.
    for i in range(n):
        from_elements(nodes[i], w.x)
        if not first:
            if not element_derivatives(w.x, 0, w.m, w.e[0], w.e[1], w.e[2]):
                return -1.0, np.inf
            for j in range(3):
                w.x[3 + j] += dv[i, j]
        if not to_elements(w.x, jumps[i]):
            return -1.0, np.inf
        for j in range(6):
            jumps[i, j] -= nodes[i, j]
        jumps[i, 5] = wrap(jumps[i, 5])
        if first:
            if not element_derivatives(w.x, 3, w.m_next, w.e[0], w.e[1], w.e[2]):
                return -1.0, np.inf
            for j in range(6):
                for k in range(3):
                    response[i, j, k] = w.m_next[j, k]
                for k in range(6):
                    w.stm[i, j, k] = 1.0 if j == k else 0.0
        else:
            if not element_derivatives(w.x, 0, w.m_next, w.e[0], w.e[1], w.e[2]):
                return -1.0, np.inf
            for j in range(6):
                for k in range(3):
                    response[i, j, k] = w.m_next[j, 3 + k]
            if not divide(w.m_next, w.m, w.stm[i]):
                return -1.0, np.inf
    # Condense, last node first: m = d(end)/d(elements after impulse i).
    for j in range(6):
        gap[j] = e1[j] - nodes[n - 1, j] - jumps[n - 1, j]
        for k in range(6):
            w.m[j, k] = 1.0 if j == k else 0.0
    gap[5] = longitude - nodes[n - 1, 5] - jumps[n - 1, 5]
    w.m[5, 0] = 0.5 * dt
    gap[5] -= 0.5 * dt * (nodes[n - 1, 0] + jumps[n - 1, 0])
    for i in range(n - 1, -1, -1):
        for j in range(6):
            for k in range(3):
                value = 0.0
                for q in range(6):
                    value += w.m[j, q] * response[i, q, k]
                w.b[i, j, k] = value
        for j in range(6):
            for k in range(6):
                value = 0.0
                for q in range(6):
                    value += w.m[j, q] * w.stm[i, q, k]
                w.m_next[j, k] = value
        # moved[i]: by how much the flow from the node before misses node i.
        span = dt if i > 0 else 0.5 * dt
        for j in range(6):
            before = nodes[i - 1, j] + jumps[i - 1, j] if i > 0 else e0[j]
            moved[i, j] = before - nodes[i, j]
        motion = nodes[i - 1, 0] + jumps[i - 1, 0] if i > 0 else e0[0]
        moved[i, 5] += motion * span
        for j in range(6):
            for k in range(6):
                w.m[j, k] = w.m_next[j, k]
                gap[j] -= w.m[j, k] * moved[i, k]
            w.m[j, 0] += w.m[j, 5] * span
    for j in range(6):
        total[j] = gap[j]
        for i in range(n):
            for k in range(3):
                total[j] += w.b[i, j, k] * dv[i, k]
    if not whiten(w.b, n, w.m, w.lower):
        return -1.0, np.inf
    solve_lower(w.lower, total)
    whiten_costate(w.lower, lam)
    z = least_thrust(w.b, total, n, n_forward, c, lam, z, dv, w.linear, w.pinned, w.dual, info)
    solve_lower_transposed(w.lower, lam)
    if not z > 0.0:
        return -1.0, np.inf
    # How the nodes move; half steps where an orbit would open.
    for j in range(6):
        work[j] = moved[0, j]
    change = 0.0
    for i in range(n):
        for j in range(6):
            moved_next = moved[i, j] if i == 0 else work[j] + moved[i, j]
            moved[i, j] = moved_next
        for j in range(6):
            value = 0.0
            for k in range(6):
                value += w.stm[i, j, k] * moved[i, k]
            for k in range(3):
                value += response[i, j, k] * (w.linear[i, k] - dv[i, k])
            work[j] = value
        work[5] += work[0] * dt
        for k in range(3):
            change += abs(w.linear[i, k] - dv[i, k])
    fraction = 1.0
    for _ in range(6):
        inside = True
        for i in range(n):
            ex = nodes[i, 1] + fraction * moved[i, 1]
            ey = nodes[i, 2] + fraction * moved[i, 2]
            motion = nodes[i, 0] + fraction * moved[i, 0]
            if not (ex * ex + ey * ey < 0.9 and 0.1 * e0[0] < motion < 10.0 * e0[0]):
                inside = False
        if inside:
            break
        fraction *= 0.5
    if not inside:
        return -1.0, np.inf
    largest = 0.0
    for i in range(n):
        for j in range(6):
            nodes[i, j] += fraction * moved[i, j]
            largest = max(largest, abs(fraction * moved[i, j]))
        for j in range(3):
            dv[i, j] += fraction * (w.linear[i, j] - dv[i, j])
    info[6] += 1
    return z, largest if fraction == 1.0 else np.inf


@kernel
def divide(a, b, quotient):
    """Write a b^-1 of (6, 6) matrices by Gauss elimination on rows of b^T; destroys both."""
    # Solve q b = a, column by column of b: column operations on the stacked [b; a].
    for i in range(6):
        pivot = i
        for j in range(i + 1, 6):
            if abs(b[i, j]) > abs(b[i, pivot]):
                pivot = j
        if b[i, pivot] == 0.0:
            return False
        if pivot != i:
            for r in range(6):
                b[r, i], b[r, pivot] = b[r, pivot], b[r, i]
                a[r, i], a[r, pivot] = a[r, pivot], a[r, i]
        inverse = 1.0 / b[i, i]
        for r in range(6):
            b[r, i] *= inverse
            a[r, i] *= inverse
        for j in range(6):
            if j != i:
                factor = b[i, j]
                for r in range(6):
                    b[r, j] -= factor * b[r, i]
                    a[r, j] -= factor * a[r, i]
    for i in range(6):
        for j in range(6):
            quotient[i, j] = a[i, j]
    return True


@kernel
def rotation(x, frame):
    """Write the rows of the frame: radial, along-track, normal of the state `x`."""
    r = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    for i in range(3):
        frame[0, i] = x[i] / r
    frame[2, 0] = x[1] * x[5] - x[2] * x[4]
    frame[2, 1] = x[2] * x[3] - x[0] * x[5]
    frame[2, 2] = x[0] * x[4] - x[1] * x[3]
    h = math.sqrt(frame[2, 0] ** 2 + frame[2, 1] ** 2 + frame[2, 2] ** 2)
    for i in range(3):
        frame[2, i] /= h
    frame[1, 0] = frame[2, 1] * frame[0, 2] - frame[2, 2] * frame[0, 1]
    frame[1, 1] = frame[2, 2] * frame[0, 0] - frame[2, 0] * frame[0, 2]
    frame[1, 2] = frame[2, 0] * frame[0, 1] - frame[2, 1] * frame[0, 0]


@kernel
def maximum_one(x0, x1, tof, c, n, screen, w, best_dv, info):
    """Find the least z of one scaled leg; return z (inf where none) and the winning start."""
    n_forward = n // 2
    dt = tof / n
    e0 = w.v6[5]
    e1 = w.v6[6]
    lam = w.v6[7]
    best = np.inf
    winner = -1
    if not to_elements(x0, e0) or not to_elements(x1, e1):
        return best, winner
    lam_of = w.start_lam
    for s in range(N_STARTS):
        turns = (s + 1) // 2 * (1 if s % 2 else -1)
        longitude = draw_path(e0, e1, tof, turns, n, w.start_nodes[s])
        w.start_z[s] = np.inf
        w.start_longitude[s] = longitude
        if math.isnan(longitude):
            continue
        z = -1.0
        for i in range(6):
            lam_of[s, i] = 0.0
        for i in range(n):
            for j in range(3):
                w.starts[s, i, j] = 0.0
        for sweep in range(2):
            new_z, move = lifted_sweep(
                e0,
                e1,
                longitude,
                dt,
                n,
                n_forward,
                c,
                sweep == 0,
                w.start_nodes[s],
                w.starts[s],
                z,
                lam_of[s],
                w,
                info,
            )
            if not new_z > 0.0:
                break
            z = new_z
        if z > 0.0:
            w.start_z[s] = z
        info[10 + s] = w.start_z[s]
    for _ in range(N_STARTS):
        s = np.argmin(w.start_z)
        z = w.start_z[s]
        if not z < np.inf or not z < screen * best:
            break
        w.start_z[s] = np.inf
        for _ in range(10):
            z, move = lifted_sweep(
                e0,
                e1,
                w.start_longitude[s],
                dt,
                n,
                n_forward,
                c,
                False,
                w.start_nodes[s],
                w.starts[s],
                z,
                lam_of[s],
                w,
                info,
            )
            if not z > 0.0 or move < 1e-3:
                break
        for i in range(6):
            lam[i] = lam_of[s, i]
        for i in range(n):
            for j in range(3):
                w.dv[i, j] = w.starts[s, i, j]
        info[3] += 1
        if not close(x0, w.dv, n, dt, e1, 1e-9, 12, w):
            info[4] += 1
            continue
        z = improve(x0, w.dv, n, n_forward, dt, c, e1, 30, 1e-4, 0.0, lam, w, info)
        info[20 + s] = z
        if z < best and close(x0, w.dv, n, dt, e1, 1e-12, 4, w):
            z = z_of_impulses(w.dv, n, n_forward, c)
            if z < best:
                best = z
                winner = s
                for i in range(n):
                    for j in range(3):
                        best_dv[i, j] = w.dv[i, j]
    return best, winner


@kernel
def maximum_batch(rv0, rv1, tof, c, n, mu, screen, infos, throttles, z_out, winner, mass_ratio):
    w = make_workspace(n)
    frame = np.empty((3, 3))
    x0 = np.empty(6)
    x1 = np.empty(6)
    dv = np.empty((n, 3))
    for row in range(rv0.shape[0]):
        length = math.sqrt(rv0[row, 0] ** 2 + rv0[row, 1] ** 2 + rv0[row, 2] ** 2)
        speed = math.sqrt(mu / length)
        rotation(rv0[row], frame)
        for i in range(3):
            x0[i] = x0[3 + i] = x1[i] = x1[3 + i] = 0.0
            for j in range(3):
                x0[i] += frame[i, j] * rv0[row, j] / length
                x0[3 + i] += frame[i, j] * rv0[row, 3 + j] / speed
                x1[i] += frame[i, j] * rv1[row, j] / length
                x1[3 + i] += frame[i, j] * rv1[row, 3 + j] / speed
        ce = c[row] / speed
        z, s = maximum_one(x0, x1, tof[row] * speed / length, ce, n, screen, w, dv, infos[row])
        z_out[row] = z
        winner[row] = s
        if s < 0:
            continue
        total = 0.0
        for i in range(n):
            y = math.sqrt(dv[i, 0] ** 2 + dv[i, 1] ** 2 + dv[i, 2] ** 2) / ce
            if i >= n // 2:
                total += y
            # throttle = dv m / (T dt) with the mass of the segment's convention.
            scale = math.exp(-total) / (z * ce)
            if i < n // 2:
                total += y
            for j in range(3):
                throttles[row, i, j] = scale * (
                    frame[0, j] * dv[i, 0] + frame[1, j] * dv[i, 1] + frame[2, j] * dv[i, 2]
                )
        mass_ratio[row] = math.exp(-total)
