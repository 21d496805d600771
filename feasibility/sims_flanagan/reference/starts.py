"""First guesses for the reference solver: sequences of impulses, one a segment.

Impulses, not throttles, because a guess must not depend on the mass that is
looked for. They are in `constants.EARTH_VELOCITY`, heliocentric frame.

The maximum initial mass of a long leg has many local optima, one or more for
each number of revolutions, and which one a start leads to depends on where it
drifts to: hence the tangential starts in four sizes, the ones that turn round
half-way, and the wandering ones.
"""

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.legs import Legs
from feasibility.runtime.pykep_guard import load_pykep


class Start(NamedTuple):
    """Number of the start, its (s, 3) impulses and (3,) excess velocities at free ends."""

    number: int
    impulses: NDArray[np.float64]
    dep_excess: NDArray[np.float64] = np.zeros(3)
    arr_excess: NDArray[np.float64] = np.zeros(3)


MAX_REVOLUTIONS: Final = 2
"""Lambert branches are tried up to this number of complete revolutions."""

N_LAMBERT: Final = 1 + 2 * MAX_REVOLUTIONS
"""Indices 0 to N_LAMBERT - 1 are Lambert branches: 0 revolutions, low and high path of 1, of 2."""

N_WANDERING: Final = 6
"""Number of wandering starts that every leg gets."""

_SIZES = (1.0, 8.0, 0.25, 3.0)
_TURN_SIZES = (3.0, 1.0)
_BASE_SIZE = 0.2
_RANDOM_EXCESS = 0.1
_MOST_REVS = 8
_ROUNDING = 1e-9

FIRST_WANDERING: Final = N_LAMBERT + 2 * len(_SIZES) + 2 * len(_TURN_SIZES)
"""Index of the first wandering start; between it and the Lambert branches the tangential ones."""

N_HOPS: Final = 10
"""Number of solves from the best solution, for legs whose starts do not agree."""

FIRST_HOP: Final = FIRST_WANDERING + N_WANDERING
"""Index of the first of these."""

FROM_GUESS: Final = FIRST_HOP + N_HOPS
"""Index of the start from a solution that the caller gives."""

FIRST_RANDOM: Final = FROM_GUESS + 1
"""Index of the first random start."""

_KNOTS = 4
_TWO_IMPULSE_STARTS = 3


def reference_starts(
    leg: Any,
    n_random: int,
    rng: np.random.Generator | None,
    dep: float = 0.0,
    arr: float = 0.0,
) -> Iterator[Start]:
    """Yield the starts of one leg, those that win most often for their number first.

    Parameters
    ----------
    leg : pykep.leg.sims_flanagan
        The leg in scaled units (`pykep_leg.scaled_leg`).
    n_random : int
        Number of random starts after the fixed ones.
    rng : numpy.random.Generator, optional
        Source of the random starts; needed if `n_random` is not 0.
    dep, arr : float
        Largest excess velocities at the ends, scaled: that of a Lambert arc is cut to them, and
        thrust along or against the velocity leaves with as much as it may; of the other
        starts half have that of the first Lambert arc, half a random one.

    Yields
    ------
    Start
        In order: the Lambert arc below one revolution; thrust along and against
        the velocity; the Lambert arcs of 1 and 2 revolutions; thrust along and
        against in other sizes, and turning round half-way; wandering directions;
        random ones.
    """
    lambert = list(_lambert(leg, dep, arr))
    tangential = list(_tangential(leg, dep))
    yield from (start for start in lambert if start[0] == 0)
    yield from tangential[:2]
    yield from (start for start in lambert if start[0] > 0)
    yield from tangential[2:]
    ends = _Ends(dep, arr, lambert[0] if lambert else None, float(np.linalg.norm(leg.rvs[1])))
    # The wandering starts are part of the method, the same for every leg and every call.
    fixed = np.random.default_rng(0)
    yield from _wandering(leg, N_WANDERING, fixed, FIRST_WANDERING, ends)
    if rng is not None:
        yield from _wandering(leg, n_random, rng, FIRST_RANDOM, ends)


class _Ends(NamedTuple):
    """Bounds of the excess velocities, where to begin with them, and a speed to measure them."""

    dep: float
    arr: float
    lambert: Start | None
    speed: float

    def excess(
        self, number: int, rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return those of a start: Lambert's and random ones in turn."""
        if not (self.dep or self.arr):
            return np.zeros(3), np.zeros(3)
        if number % 2 == 0 and self.lambert is not None:
            return self.lambert.dep_excess, self.lambert.arr_excess
        draws = rng.normal(size=(2, 3)) * _RANDOM_EXCESS * self.speed
        return cut(draws[0], self.dep), cut(draws[1], self.arr)


def cut(excess: NDArray[np.float64], bound: float) -> NDArray[np.float64]:
    """Return an excess velocity (3,) of at most the bound."""
    size = float(np.linalg.norm(excess))
    return excess if size <= bound else excess * (bound / size)


def ballistic(leg: Any, dep: float, arr: float) -> tuple[NDArray[np.float64], ...] | None:
    """Return the excess velocities of the gentlest Kepler arc within the bounds, None without."""
    (r_dep, v_dep), (r_arr, v_arr) = leg.rvs, leg.rvf
    best: tuple[NDArray[np.float64], ...] | None = None
    if np.cross(r_dep, r_arr)[2] == 0.0:
        return None
    for backward in (False, True):
        arcs = load_pykep().lambert_problem(
            r0=r_dep, r1=r_arr, tof=leg.tof, mu=leg.mu, cw=backward, multi_revs=_MOST_REVS
        )
        for v0, v1 in zip(arcs.v0, arcs.v1, strict=True):
            both = np.array(v0) - v_dep, np.array(v1) - v_arr
            first, second = (float(np.linalg.norm(excess)) for excess in both)
            within = first <= dep + _ROUNDING and second <= arr + _ROUNDING
            if within and (best is None or first + second < sum(map(np.linalg.norm, best))):
                best = both
    return None if best is None else (cut(best[0], dep), cut(best[1], arr))


def _lambert(leg: Any, dep: float, arr: float) -> Iterator[Start]:
    """Yield the two impulses of every Lambert branch, each spread over its half of the leg.

    Excess velocities take over what they can. The arcs turn as the departure orbit does, be it
    prograde or retrograde.
    """
    (r_dep, v_dep), (r_arr, v_arr) = leg.rvs, leg.rvf
    normal = np.cross(r_dep, r_arr)
    if normal[2] == 0.0:
        # pykep cannot tell one sense of rotation from the other there; other starts remain.
        return
    backward = bool(normal @ np.cross(r_dep, v_dep) * normal[2] < 0.0)
    arcs = load_pykep().lambert_problem(
        r0=r_dep, r1=r_arr, tof=leg.tof, mu=leg.mu, cw=backward, multi_revs=MAX_REVOLUTIONS
    )
    half = leg.nseg_fwd
    for branch, (v0, v1) in enumerate(zip(arcs.v0, arcs.v1, strict=True)):
        impulses = np.empty((leg.nseg, 3))
        first, second = np.array(v0) - v_dep, np.array(v1) - v_arr
        # The transfer plane is not defined at 180 degrees.
        if np.isfinite(first).all() and np.isfinite(second).all():
            leaving, arriving = cut(first, dep), cut(second, arr)
            impulses[:half] = (first - leaving) / half
            impulses[half:] = (arriving - second) / (leg.nseg - half)
            yield Start(branch, impulses, leaving, arriving)


def two_impulse_starts(legs: Legs, row: int, n_segments: int) -> NDArray[np.float64]:
    """Return (k, s, 3) m/s, impulses of the cheapest two-impulse arcs of a leg, cheapest first."""
    from feasibility.sims_flanagan.fast.restart_kernels import two_impulse_batch

    one = legs.take([row])
    impulses = np.empty((1, _TWO_IMPULSE_STARTS, n_segments, 3))
    push = one.thrust * one.tof_s / n_segments / one.m0
    counts = two_impulse_batch(
        one.rv_dep.copy(), one.rv_arr.copy(), one.tof_s, push, MU_SUN, impulses
    )
    found: NDArray[np.float64] = impulses[0, : int(counts[0])]
    return found


def _tangential(leg: Any, dep: float) -> Iterator[Start]:
    """Yield impulses along and against the velocity of the coasted departure orbit."""
    pykep = load_pykep()
    along = np.empty((leg.nseg, 3))
    for segment in range(leg.nseg):
        tof = leg.tof * (segment + 0.5) / leg.nseg
        along[segment] = pykep.propagate_lagrangian(rv=leg.rvs, tof=tof, mu=leg.mu)[1]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    turning = np.where(np.arange(leg.nseg) < leg.nseg_fwd, 1.0, -1.0)[:, None] * along
    index = N_LAMBERT
    for sizes, directions in ((_SIZES, along), (_TURN_SIZES, turning)):
        for size in sizes:
            for sign in (1.0, -1.0):
                impulses = sign * size * _impulse(leg) * directions
                leaving = cut(sign * _RANDOM_EXCESS * np.array(leg.rvs[1]), dep)
                yield Start(index, impulses, leaving)
                index += 1


def _wandering(
    leg: Any, n_starts: int, rng: np.random.Generator, first_index: int, ends: _Ends
) -> Iterator[Start]:
    """Yield impulses whose direction wanders smoothly from knot to knot, in two sizes."""
    for number in range(n_starts):
        path = _smooth_path(leg.nseg, rng)
        norms = np.maximum(np.linalg.norm(path, axis=1, keepdims=True), 1e-9)
        size = 1.0 if number % 2 else 3.0
        impulses = size * _impulse(leg) * path / norms
        yield Start(first_index + number, impulses, *ends.excess(number, rng))


def bends(n_segments: int, n: int) -> Iterator[NDArray[np.float64]]:
    """Yield what is added to the throttles of a solution to leave its optimum.

    Parameters
    ----------
    n_segments : int
        Number of segments, s.
    n : int
        How many.

    Yields
    ------
    (s, 3) float64
        First zeros, for a solver that stopped early, then smooth disturbances of
        the size of the throttles; the same for every leg.
    """
    rng = np.random.default_rng(0)
    for number in range(n):
        yield _smooth_path(n_segments, rng) if number else np.zeros((n_segments, 3))


def _smooth_path(n_segments: int, rng: np.random.Generator) -> NDArray[np.float64]:
    at = np.linspace(0.0, _KNOTS - 1.0, n_segments)
    knots = rng.normal(size=(3, _KNOTS))
    return np.stack([np.interp(at, np.arange(_KNOTS), axis) for axis in knots], axis=1)


def _impulse(leg: Any) -> float:
    """Return the impulse of one segment for starts that have no size of their own.

    It only sets the mass at which the solver starts, and so how far it first drifts.
    """
    return float(np.linalg.norm(leg.rvs[1])) * _BASE_SIZE / float(leg.nseg)
