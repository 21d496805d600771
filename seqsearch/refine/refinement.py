"""`refine_tour`: the legs of a tour in order, each with the mass that those before it leave."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.continuous import TIME_PRICE, ContinuousArc, ContinuousLeg, refine_leg
from feasibility.errors import InputError
from seqsearch.refine.refined import RefinedLeg, RefinedTour
from seqsearch.refine.timetable import Timetable
from seqsearch.tours.bodies.told_motion import motion_of
from seqsearch.tours.labels import body_label
from seqsearch.tours.records import TourLeg, Vector
from seqsearch.tours.tour import Tour
from seqsearch.tours.trajectory import Phase, Trajectory

OnLeg = Callable[[RefinedLeg], None]
"""Called after each leg."""

_SPARE_KG: Final = 1e-6
_LATE_DAYS: Final = 1e-9


@final
@dataclass(frozen=True)
class _Attempt:
    """A way to share out what continuous thrust lacks.

    Attributes
    ----------
    time_price : float
        What a day is worth, in days of full thrust.
    catch_up : bool
        Whether legs that depart late may fly faster than in the tour.
    """

    time_price: float
    catch_up: bool


_ATTEMPTS: Final = tuple(
    _Attempt(price, catch_up)
    for price in (TIME_PRICE, 20.0, 8.0, 5.0, 3.5)
    for catch_up in (False, True)
)
"""Times are kept first; where that leaves too little mass, time is spent on propellant."""


class _FailedError(Exception):
    """An attempt that failed; says where and by how much."""


def refine_tour(
    tour: Tour, *, time_price: float | None = None, on_leg: OnLeg | None = None
) -> RefinedTour:
    """Refine a tour to continuous thrust.

    Each leg keeps its times where it can. Where thrust that is spread over time cannot do what
    impulses did, the arrival is later, and so is what follows until a longer stay absorbs it.

    Parameters
    ----------
    tour : Tour
        At least one leg.
    time_price : float, optional
        What a day's delay may cost, in days of full thrust; default: 50, and less where too
        little mass would be left.
    on_leg : callable, optional
        Called with each leg as it is done; legs may be done again.

    Raises
    ------
    InputError
        The tour has no leg, or a leg cannot be flown with continuous thrust within the times and
        masses of the rules; with the leg and what is missing.
    """
    if not tour.legs:
        raise InputError("the tour has no leg, so there is nothing to refine")
    if time_price is not None and not 0.0 < time_price < np.inf:
        raise InputError(f"time price {time_price:g}, expected more than 0")
    attempts = _ATTEMPTS
    if time_price is not None:
        attempts = (_Attempt(time_price, catch_up=False), _Attempt(time_price, catch_up=True))
    failures = []
    for attempt in attempts:
        try:
            return _refined(tour, attempt, on_leg)
        except _FailedError as error:
            failures.append(str(error))
    raise InputError(failures[0])


def _refined(tour: Tour, attempt: _Attempt, on_leg: OnLeg | None) -> RefinedTour:
    table = Timetable.of(tour)
    mass = tour.legs[0].m0_kg
    phases: list[Phase] = []
    legs: list[RefinedLeg] = []
    arc: ContinuousArc | None = None
    for k, leg in enumerate(tour.legs):
        before = tour.legs[k - 1] if k else None
        arc = _arc(
            tour,
            k,
            mass,
            table,
            attempt,
            arc if before and before.is_fly_by else None,
            None if arc is None else arc.t_arr_mjd2000,
        )
        phases.append(_phase(tour, leg, arc))
        legs.append(_leg(tour, k, table, arc))
        if on_leg is not None:
            on_leg(legs[-1])
        label = f"leg {k + 1}, {legs[-1].start} -> {legs[-1].end}"
        if not arc.converged:
            raise _FailedError(
                f"{label}: no continuous thrust within the tour's times closes it; what comes "
                f"nearest misses by {arc.miss_km:.4g} km and {arc.miss_m_s:.4g} m/s "
                f"(margin with impulses {leg.margin:.4f}, arrival until "
                f"{table.latest_arrival(k):.2f} MJD2000)"
            )
        mass = float(arc.mass_kg[-1]) - leg.dropped_kg
        if mass < tour.rules.m_dry_kg - _SPARE_KG:
            raise _FailedError(
                f"{label}: {mass:.3f} kg are left after it with continuous thrust, "
                f"{tour.rules.m_dry_kg - mass:.3f} kg less than the dry mass"
            )
    duration = legs[-1].t_arr_mjd2000 - legs[0].t_dep_mjd2000
    trajectory = Trajectory(tuple(phases), continuous=True)
    return RefinedTour(trajectory, tuple(legs), mass, duration, attempt.time_price)


def _arc(
    tour: Tour,
    k: int,
    mass: float,
    table: Timetable,
    attempt: _Attempt,
    passed: ContinuousArc | None,
    arrived: float | None,
) -> ContinuousArc:
    """Refine leg k. `passed` is the arc before it, where that ended with a fly-by."""
    leg, rules = tour.legs[k], tour.rules
    t_dep = table.departure(k, arrived)
    if passed is None:
        departure = _state(tour, leg.from_id, leg.dep_velocity_m_s, t_dep)
    else:
        departure = passed.states[-1]
    target = partial(_state, tour, leg.to_id, leg.arr_velocity_m_s)
    planned = table.arrivals[k]
    late = t_dep - table.departures[k]
    arrival = planned + late if late > _LATE_DAYS else planned
    latest = max(table.latest_arrival(k), planned)
    return refine_leg(
        ContinuousLeg(
            departure=departure,
            target=target,
            t_dep_mjd2000=t_dep,
            m0_kg=mass,
            thrust_n=rules.thrust_n,
            exhaust_velocity_m_s=rules.isp_s * rules.g0_m_s2,
            mu_m3_s2=rules.mu_m3_s2,
        ),
        min(arrival, latest),
        [impulse.throttle for impulse in leg.impulses],
        impulses_m_s=[impulse.dv_m_s for impulse in leg.impulses],
        arrival_mjd2000=(planned if attempt.catch_up else min(arrival, latest), latest),
        time_price=attempt.time_price,
    )


def _state(tour: Tour, body_id: int, relative: Vector, t_mjd2000: float) -> NDArray[np.float64]:
    """Return the (6,) state of a body, with a velocity relative to it added."""
    state: NDArray[np.float64] = motion_of(tour, tour.body(body_id), [t_mjd2000])[0]
    state[3:] += relative
    return state


def _phase(tour: Tour, leg: TourLeg, arc: ContinuousArc) -> Phase:
    return Phase(
        body_label(tour, leg.from_id),
        body_label(tour, leg.to_id),
        arc.edges_mjd2000,
        arc.states,
        arc.mass_kg,
        np.concatenate([arc.thrust_n, np.zeros((1, 3))]),
    )


def _leg(tour: Tour, k: int, table: Timetable, arc: ContinuousArc) -> RefinedLeg:
    leg = tour.legs[k]
    t_dep = float(arc.edges_mjd2000[0])
    return RefinedLeg(
        start=body_label(tour, leg.from_id),
        end=body_label(tour, leg.to_id),
        t_dep_mjd2000=t_dep,
        t_arr_mjd2000=arc.t_arr_mjd2000,
        departure_delay_days=t_dep - table.departures[k],
        arrival_delay_days=arc.t_arr_mjd2000 - table.arrivals[k],
        m0_kg=float(arc.mass_kg[0]),
        m_final_kg=float(arc.mass_kg[-1]),
        propellant_kg=arc.propellant_kg,
        impulsive_propellant_kg=leg.m0_kg - leg.m_final_kg,
        miss_km=arc.miss_km,
        miss_m_s=arc.miss_m_s,
        iterations=arc.iterations,
    )
