"""Arcs of segments with constant thrust: where they lead, and how that depends on the thrust."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.continuous.series_kernels import (
    COLUMNS,
    MASS,
    ORDER,
    SIZE,
    STATE,
    STEP,
    THROTTLE,
    end_of,
    force,
    gradient,
    motion,
    variation,
)
from feasibility.runtime.jit import inner_kernel, kernel

_Array = NDArray[np.float64]


@inner_kernel
def steps_of(x: _Array, dt: float) -> int:
    """Return into how many steps what is left of a segment is cut, from where it is now."""
    radius = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    return 1 + int(dt / (STEP * radius * math.sqrt(radius)))


@kernel
def shoot(x0: _Array, u: _Array, dt: _Array, push: float, burn: float, nodes: _Array) -> None:
    """Write the states and masses at the ends of all segments.

    Parameters
    ----------
    x0 : (6,) array
        State at the departure; the mass there is 1.
    u : (n, 3) array
        Throttle vectors.
    dt : (n,) array
        Lengths of the segments.
    push, burn : float
        Acceleration and mass flow of the full thrust at mass 1.
    nodes : (n + 1, 7) array
        Written: state and mass at the beginning and after each segment.
    """
    r = np.empty((ORDER + 1, 3))
    w = np.empty(ORDER)
    q = np.empty(ORDER)
    end = np.empty((6, 1))
    x = np.empty(6)
    nodes[0, :6] = x0
    nodes[0, 6] = 1.0
    for k in range(len(dt)):
        x[:] = nodes[k, :6]
        mass = nodes[k, 6]
        s = math.sqrt(u[k, 0] ** 2 + u[k, 1] ** 2 + u[k, 2] ** 2)
        left = dt[k]
        while left > 0.0:
            steps = steps_of(x, left)
            h = left / steps
            left = left - h if steps > 1 else 0.0
            motion(x, mass, u[k], s, push, burn, w, q, r)
            end_of(r, h, end, int(0))
            x[:] = end[:, 0]
            mass -= burn * s * h
        nodes[k + 1, :6] = x
        nodes[k + 1, 6] = mass


@kernel
def shoot_derivatives(
    u: _Array,
    dt: _Array,
    push: float,
    burn: float,
    joined: bool,
    nodes: _Array,
    ends: _Array,
    jacobian: _Array,
) -> None:
    """Write the ends of all segments and their derivatives.

    Parameters
    ----------
    u, dt, push, burn
        As `shoot`.
    joined : bool
        Whether each segment begins where the one before ends; otherwise at the given nodes.
    nodes : (n + 1, 7) array
        States and masses at the beginning of the segments and at the arrival. The first state is
        given; the masses are written, and where segments are joined the other states.
    ends : (n, 6) array
        Written: states at the ends of the segments.
    jacobian : (n, 6, 11) array
        Written: derivatives of the ends by state and throttle vector at the beginning, by mass,
        and by the size of the throttle.
    """
    r = np.empty((ORDER + 1, 3))
    w = np.empty(ORDER)
    q = np.empty(ORDER)
    five = np.empty(ORDER)
    square = np.empty((ORDER, 6))
    g = np.empty((ORDER, 6))
    forcing = np.empty((ORDER, 3))
    d = np.empty((ORDER + 1, 3))
    end = np.empty((6, 1))
    x = np.empty(6)
    step = np.empty((6, COLUMNS))
    nodes[0, 6] = 1.0
    for k in range(len(dt)):
        x[:] = nodes[k, :6]
        mass = nodes[k, 6]
        s = math.sqrt(u[k, 0] ** 2 + u[k, 1] ** 2 + u[k, 2] ** 2)
        left = dt[k]
        while left > 0.0:
            steps = steps_of(x, left)
            h = left / steps
            passed = dt[k] - left
            left = left - h if steps > 1 else 0.0
            motion(x, mass, u[k], s, push, burn, w, q, r)
            gradient(w, q, r, five, square, g)
            for column in range(COLUMNS):
                d[0] = 0.0
                d[1] = 0.0
                if column < 3:
                    d[0, column] = 1.0
                elif column < THROTTLE:
                    d[1, column - 3] = 1.0
                force(column, mass, u[k], s, push, burn, forcing)
                variation(g, forcing, d)
                end_of(d, h, step, column)
            _compose(step, jacobian[k], burn * passed, passed == 0.0)
            end_of(r, h, end, int(0))
            x[:] = end[:, 0]
            mass -= burn * s * h
        ends[k] = x
        if joined:
            nodes[k + 1, :6] = x
        nodes[k + 1, 6] = mass


@inner_kernel
def _compose(step: _Array, whole: _Array, burnt_by_size: float, first: bool) -> None:
    """Put the derivatives of a step after those of the steps before it."""
    if first:
        whole[:] = step
        return
    column = np.empty(6)
    for c in range(COLUMNS):
        for i in range(6):
            total = 0.0
            for j in range(6):
                total += step[i, STATE + j] * whole[j, c]
            if c >= THROTTLE:
                total += step[i, c]
            if c == SIZE:
                total -= burnt_by_size * step[i, MASS]
            column[i] = total
        for i in range(6):
            whole[i, c] = column[i]


@kernel
def sensitivities(
    jacobian: _Array, defects: _Array, dt: _Array, burn: float, b: _Array, by_size: _Array
) -> _Array:
    """Return the gap at the arrival; write its derivatives by all throttles.

    Parameters
    ----------
    jacobian : (n, 6, 11) array
        Of `shoot_derivatives`.
    defects : (n, 6) array
        Ends of the segments less the beginnings of those after them, in the last row less the
        target: together they make the gap, to first order.
    dt : (n,) array
        Lengths of the segments.
    burn : float
        Mass flow of the full thrust.
    b : (n, 6, 3) array
        Written: by the throttle vectors, at given masses.
    by_size : (n, 6) array
        Written: by the sizes of the throttles, which change all masses after them.

    Returns
    -------
    (6,) array
    """
    m = np.eye(6)
    m_next = np.empty((6, 6))
    by_mass = np.zeros(6)
    gap = np.zeros(6)
    for k in range(len(dt) - 1, -1, -1):
        part = jacobian[k]
        for i in range(6):
            for c in range(3):
                total = 0.0
                for j in range(6):
                    total += m[i, j] * part[j, THROTTLE + c]
                b[k, i, c] = total
            by_s, by_m = 0.0, 0.0
            for j in range(6):
                by_s += m[i, j] * part[j, SIZE]
                by_m += m[i, j] * part[j, MASS]
                gap[i] += m[i, j] * defects[k, j]
            by_size[k, i] = by_s - burn * dt[k] * by_mass[i]
            by_mass[i] += by_m
            for c in range(6):
                total = 0.0
                for j in range(6):
                    total += m[i, j] * part[j, c]
                m_next[i, c] = total
        m[:] = m_next
    return gap


@kernel
def follow(
    jacobian: _Array,
    defects: _Array,
    dt: _Array,
    burn: float,
    du: _Array,
    ds: _Array,
    nodes: _Array,
) -> None:
    """Move the states `nodes` (n + 1, 7) as changes of the throttles do, to first order.

    Parameters
    ----------
    jacobian, defects, dt, burn
        As `sensitivities`.
    du : (n, 3) array
        Changes of the throttle vectors.
    ds : (n,) array
        Changes of their sizes.
    nodes
        As `shoot_derivatives`; overwritten.
    """
    x = np.zeros(6)
    x_next = np.empty(6)
    mass = 0.0
    for k in range(len(dt)):
        part = jacobian[k]
        for i in range(6):
            total = defects[k, i] + part[i, SIZE] * ds[k] + part[i, MASS] * mass
            for j in range(6):
                total += part[i, j] * x[j]
            for c in range(3):
                total += part[i, THROTTLE + c] * du[k, c]
            x_next[i] = total
        mass -= burn * dt[k] * ds[k]
        for i in range(6):
            x[i] = x_next[i]
            nodes[k + 1, i] += x[i]
