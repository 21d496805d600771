"""`refine_leg`: a leg of impulses becomes one of continuous thrust with the least propellant.

Sequential convex programming. Each iteration linearises the arc about its throttles, solves the
convex problem that is left (`feasibility.continuous.dual_kernels`) and takes the step if a merit
function, propellant plus gap, agrees. From the impulses of a Sims-Flanagan leg it takes three to
ten iterations, because the dynamics are almost linear in the throttles; the convergence is
quadratic in the gap.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.continuous.grid import daily_edges, file_epoch, impulsive_path, on_grid
from feasibility.continuous.leg import ContinuousArc, ContinuousLeg
from feasibility.continuous.model import Caution, LegModel, Point, Step
from feasibility.errors import InputError

_Array = NDArray[np.float64]

CLOSED: Final = 2e-10
"""Gap at the arrival, in units of 1 AU and the circular speed there: 30 m and 6 um/s."""

TIME_PRICE: Final = 50.0
"""What a day's delay may cost at most, in days of full thrust: a leg is late only where it has
to be, or where keeping time would cost out of all proportion."""

_STATIONARY: Final = 1e-6
"""Relative saving below which a step is not worth taking."""

_ITERATIONS: Final = 60
_PROX: Final = 0.05
_PROX_RANGE: Final = (2e-3, 1e4)
_BEND: Final = 1e-3
_SETTLED_GAP: Final = 1e-5
_SETTLE_AFTER: Final = 3
"""Iterations with so small a gap after which the arrival is moved with ever more caution."""

_NEAR: Final = 1e-4
"""Gap from which throttles are near enough to a solution to be flown from the departure on."""

_JOININGS: Final = 20
_JOINING: Final = Caution(0.3, 1e3)
"""How often segments are joined before that, and how cautiously; the arrival stays."""

_TAKEN: Final = 0.1
_TRUSTED: Final = 0.7
"""Share of the promised gain from which a step is taken, and the next one may be bolder."""


def refine_leg(
    leg: ContinuousLeg,
    t_arr_mjd2000: float,
    throttles: ArrayLike,
    *,
    impulses_m_s: ArrayLike | None = None,
    arrival_mjd2000: tuple[float, float] | None = None,
    time_price: float = TIME_PRICE,
) -> ContinuousArc:
    """Return the arc of least propellant near a given thrust profile.

    The thrust is constant over each day from the departure, and over what is left at the arrival.

    Parameters
    ----------
    leg : ContinuousLeg
        Where from, where to, with what.
    t_arr_mjd2000 : float
        Arrival to begin with; later than the departure.
    throttles : array_like
        (s, 3) throttle vectors of s equal segments, for instance of a Sims-Flanagan solution.
    impulses_m_s : array_like, optional
        (s, 3) impulses at the centres of these segments. They give the path to begin with, which
        legs of several revolutions need.
    arrival_mjd2000 : tuple of float, optional
        Earliest and latest arrival; default: as given.
    time_price : float
        What a day's delay costs, in days of full thrust. The propellant of a leg falls with its
        flight time, ever more slowly: the arrival is where a day is worth this.

    Returns
    -------
    ContinuousArc
        With ``converged`` False where no arc within the thrust and the times was found; it then
        has the least gap and propellant that were found together.

    Raises
    ------
    InputError
        The arrival is not after the departure, throttles have another shape, or a number is not
        finite.
    """
    start = np.array(throttles, dtype=np.float64)
    if start.ndim != 2 or start.shape[1] != 3 or not len(start):
        raise InputError(f"throttles: got shape {start.shape}, expected (segments, 3)")
    # Solvers give NaN for a leg that they cannot fly, with which no iteration would end.
    if (
        not np.isfinite(start).all()
        or not np.isfinite(0.0 if impulses_m_s is None else impulses_m_s).all()
    ):
        raise InputError("throttles or impulses: a number that is not finite")
    if not leg.t_dep_mjd2000 < t_arr_mjd2000:
        raise InputError(
            f"arrival {t_arr_mjd2000:.6f}, expected after the departure {leg.t_dep_mjd2000:.6f}"
        )
    window = arrival_mjd2000 or (t_arr_mjd2000, t_arr_mjd2000)
    earliest, latest = (float(file_epoch(epoch)) for epoch in window)
    model = LegModel(leg, (earliest, latest), time_price)
    edges = daily_edges(leg.t_dep_mjd2000, t_arr_mjd2000)
    point = model.point(edges, on_grid(start, edges))
    if impulses_m_s is not None and point.gap_size > _NEAR:
        path = impulsive_path(
            leg.departure, np.array(impulses_m_s, dtype=np.float64), edges, leg.mu_m3_s2
        )
        point = _from_path(model, point, path)
    point, converged, iterations = _iterate(model, point)
    return _arc(model, point, converged, iterations)


def _from_path(model: LegModel, point: Point, path: _Array) -> Point:
    """Return a point near a path whose throttles alone do not follow it."""
    best, throttles, states = point, point.throttles, model.scale.state(path)
    for _ in range(_JOININGS):
        throttles, states = model.joined(point.edges_mjd2000, throttles, states, _JOINING)
        trial = model.point(point.edges_mjd2000, throttles)
        if trial.gap_size < best.gap_size:
            best = trial
        if best.gap_size < _NEAR:
            break
    return best


def _iterate(model: LegModel, point: Point) -> tuple[Point, bool, int]:
    """Return the best point, whether it is closed and stationary, and the iterations."""
    multipliers = np.zeros(6)
    prox, settling = _PROX, 0
    for iteration in range(1, _ITERATIONS + 1):
        settling += point.gap_size < _SETTLED_GAP
        bend = _BEND * 4.0 ** max(0, settling - _SETTLE_AFTER)
        step = model.best_step(model.linearised(point), Caution(prox, bend), multipliers)
        trial = model.after(point, step)
        promised, gained = _gains(model, point, step, trial)
        closed = trial.gap_size < CLOSED
        settled = abs(promised) < _STATIONARY * max(point.thrust_time, _STATIONARY)
        if closed and settled:
            return trial, True, iteration
        if gained > _TAKEN * promised:
            point, multipliers = trial, step.multipliers
            if gained > _TRUSTED * promised:
                prox = max(prox / 3.0, _PROX_RANGE[0])
        elif prox > _PROX_RANGE[1]:
            break
        else:
            prox *= 4.0
    return point, point.gap_size < CLOSED, iteration


def _gains(model: LegModel, point: Point, step: Step, trial: Point) -> tuple[float, float]:
    """Return by how much a step lowers the merit in the model, and in truth."""
    gap_price = 1.0 + 2.0 * float(np.linalg.norm(step.multipliers))
    delay = model.price_per_day * step.delay_days
    before = point.thrust_time + gap_price * point.gap_size
    promised = before - (step.thrust_time + delay + gap_price * step.miss)
    gained = before - (trial.thrust_time + delay + gap_price * trial.gap_size)
    return promised, gained


def _arc(model: LegModel, point: Point, converged: bool, iterations: int) -> ContinuousArc:
    leg = model.leg
    gap = model.scale.si(point.gap)
    return ContinuousArc(
        edges_mjd2000=point.edges_mjd2000,
        states=model.scale.si(point.nodes[:, :6]),
        mass_kg=point.nodes[:, 6] * leg.m0_kg,
        thrust_n=point.throttles * model.full_thrust_n,
        miss_km=float(np.linalg.norm(gap[:3])) / 1e3,
        miss_m_s=float(np.linalg.norm(gap[3:])),
        converged=converged,
        iterations=iterations,
    )
