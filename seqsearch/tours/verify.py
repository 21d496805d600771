"""Independent verification of a tour.

Nothing here is shared with the leg solver or the search, neither code nor imports: bodies are
propagated by solving Kepler's equation with scipy, legs by integrating the equations of
motion with scipy's DOP853 between impulses, and every rule of the problem is
checked again from the numbers in ``sequence.json``.
"""

from itertools import pairwise
from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import AU, DAY_S
from seqsearch.tours.checks import (
    MASS_TOLERANCE_KG,
    SPEED_TOLERANCE_M_S,
    TIME_TOLERANCE_DAYS,
    Arrival,
    Check,
    FlownTour,
    Verification,
)
from seqsearch.tours.events.make import event_kinds
from seqsearch.tours.motion import body_state, fly
from seqsearch.tours.tour import Tour

POSITION_TOLERANCE_KM: Final = 1000.0
"""Largest miss distance at arrival (GTOC5, GTOC7 and GTOC12 problem statements)."""

VELOCITY_TOLERANCE_M_S: Final = 1.0
"""Largest velocity error at arrival (GTOC5, GTOC7 and GTOC12 problem statements)."""

_THROTTLE_TOLERANCE: Final = 1e-6
_ELEMENT_TOLERANCE: Final = 1e-12
_SCORE_TOLERANCE: Final = 1e-9


class ElementTable(Protocol):
    """The bodies of an asteroid table; `feasibility.orbits.Catalogue` is one."""

    @property
    def epoch_mjd2000(self) -> NDArray[np.float64]: ...  # noqa: D102
    @property
    def elements(self) -> NDArray[np.float64]: ...  # noqa: D102

    def rows_of(self, ids: ArrayLike, /) -> NDArray[np.int64]:
        """Return the rows of ids."""
        ...


def verify_tour(tour: Tour, catalogue: ElementTable | None = None) -> Verification:
    """Check a tour against its rules and the laws of motion.

    Parameters
    ----------
    tour : Tour
        The tour, as read from ``sequence.json``.
    catalogue : ElementTable, optional
        If given, the elements in the tour are compared with the table's own.

    Returns
    -------
    Verification
        All checks; a tour without legs passes if its start is allowed.
    """
    flown = FlownTour(tour.bodies, tour.legs, _arrivals(tour))
    checks = [*_check_order(tour), *_check_times(tour), *_check_masses(tour)]
    checks += [*_check_thrust(tour), *_check_arrivals(flown)]
    given = {type(event) for event in tour.rules.events}
    absent = (kind.forbidden() for kind in event_kinds().values() if kind not in given)
    for event in (*tour.rules.events, *absent):
        if event is not None:
            checks += event.checks(flown)
    checks.append(_check_score(tour))
    if catalogue is not None:
        checks.append(_check_elements(tour, catalogue))
    return Verification(tuple(checks))


def _arrivals(tour: Tour) -> tuple[Arrival | None, ...]:
    """Integrate every leg; None where a body is missing, which the check of the order finds."""
    mu = tour.rules.mu_m3_s2
    bodies = {body.id: body for body in tour.bodies}
    return tuple(
        Arrival(
            fly(leg, bodies[leg.from_id], mu), body_state(bodies[leg.to_id], leg.t_arr_mjd2000, mu)
        )
        if leg.from_id in bodies and leg.to_id in bodies
        else None
        for leg in tour.legs
    )


def _check_order(tour: Tour) -> list[Check]:
    ids = [body.id for body in tour.bodies]
    chain = [(leg.from_id, leg.to_id) for leg in tour.legs]
    stops = [ids[0], *(leg.to_id for leg in tour.legs if not leg.is_fly_by)]
    places = [ids[0], *(leg.to_id for leg in tour.legs)]
    linked = chain == list(pairwise(places)) and stops == ids
    repeated = sorted({body for body in ids if ids.count(body) > 1})
    start_ids = tour.rules.start_ids
    return [
        Check(
            "legs join the bodies in order", linked, "joined" if linked else str(chain), "joined"
        ),
        Check("no body twice", not repeated, str(repeated) if repeated else "none", "none"),
        Check(
            "start body allowed",
            not start_ids or ids[0] in start_ids,
            str(ids[0]),
            str(list(start_ids)) if start_ids else "any",
        ),
    ]


def _check_times(tour: Tour) -> list[Check]:
    rules = tour.rules
    earliest, latest = rules.first_departure_mjd2000
    departure = tour.legs[0].t_dep_mjd2000 if tour.legs else tour.t_start_mjd2000
    outside = max(earliest - departure, departure - latest)
    stays = [
        following.t_dep_mjd2000 - leg.t_arr_mjd2000
        for leg, following in pairwise(tour.legs)
        if not leg.is_fly_by
    ]
    shortest = min(stays, default=np.inf)
    positive = all(leg.tof_days > 0 for leg in tour.legs)
    jump = 0.0
    for leg, following in pairwise(tour.legs):
        change = np.subtract(following.dep_velocity_m_s, leg.arr_velocity_m_s)
        jump = max(jump, float(np.linalg.norm(change)))
    return [
        Check(
            "velocity continuous along the tour",
            jump <= SPEED_TOLERANCE_M_S,
            f"largest jump {jump:.2e} m/s",
            f"{SPEED_TOLERANCE_M_S:g} m/s",
        ),
        Check(
            "first departure in the window",
            outside <= TIME_TOLERANCE_DAYS,
            f"{departure:.3f} MJD2000",
            f"{earliest:.3f} to {latest:.3f}",
        ),
        Check(
            "duration",
            positive and tour.duration_days <= rules.max_duration_days + TIME_TOLERANCE_DAYS,
            f"{tour.duration_days:.3f} days",
            f"{rules.max_duration_days:.3f} days",
        ),
        Check(
            "stays",
            shortest >= rules.min_stay_days - TIME_TOLERANCE_DAYS,
            f"{shortest:.3f} days",
            f"at least {rules.min_stay_days:.3f} days",
        ),
    ]


def _check_masses(tour: Tour) -> list[Check]:
    rules = tour.rules
    masses = [rules.m0_kg]
    gap = 0.0
    rocket = 0.0
    exhaust = rules.isp_s * rules.g0_m_s2
    for leg in tour.legs:
        # Masses as the impulses say them: from the leg's start, across each impulse, to its end.
        befores = [impulse.mass_before_kg for impulse in leg.impulses] + [leg.m_final_kg]
        afters = [leg.m0_kg] + [impulse.mass_after_kg for impulse in leg.impulses]
        gap = max(gap, *(abs(b - a) for b, a in zip(befores, afters, strict=True)))
        gap = max(gap, abs(masses[-1] - leg.m0_kg))
        for impulse in leg.impulses:
            speed = float(np.linalg.norm(impulse.dv_m_s))
            expected = impulse.mass_before_kg * np.exp(-speed / exhaust)
            rocket = max(rocket, abs(expected - impulse.mass_after_kg))
        masses.append(leg.m_final_kg - leg.dropped_kg)
    return [
        Check(
            "mass continuous along the tour",
            gap <= MASS_TOLERANCE_KG,
            f"largest jump {gap:.2e} kg",
            f"{MASS_TOLERANCE_KG} kg",
        ),
        Check(
            "rocket equation at each impulse",
            rocket <= MASS_TOLERANCE_KG,
            f"largest error {rocket:.2e} kg",
            f"{MASS_TOLERANCE_KG} kg",
        ),
        Check(
            "final mass",
            min(masses) >= rules.m_dry_kg - MASS_TOLERANCE_KG,
            f"{min(masses):.3f} kg",
            f"at least {rules.m_dry_kg:.3f} kg",
        ),
    ]


def _check_thrust(tour: Tour) -> list[Check]:
    throttle = 0.0
    excess = 0.0
    misplaced = 0.0
    for leg in tour.legs:
        n = len(leg.impulses)
        segment_s = leg.tof_days * DAY_S / n
        for k, impulse in enumerate(leg.impulses):
            throttle = max(throttle, float(np.linalg.norm(impulse.throttle)))
            # The model's impulse: mass before it in the first half, after it in the second.
            mass = impulse.mass_before_kg if k < n // 2 else impulse.mass_after_kg
            dv = np.asarray(impulse.throttle) * tour.rules.thrust_n * segment_s / mass
            excess = max(excess, float(np.linalg.norm(dv - np.asarray(impulse.dv_m_s))))
            centre = leg.t_dep_mjd2000 + (k + 0.5) * leg.tof_days / n
            misplaced = max(misplaced, abs(impulse.t_mjd2000 - centre))
    return [
        Check(
            "throttles",
            throttle <= 1 + _THROTTLE_TOLERANCE,
            f"largest {throttle:.9f}",
            f"1 + {_THROTTLE_TOLERANCE:g}",
        ),
        Check(
            "impulses are thrust x time x throttle / mass",
            excess <= 1e-3,
            f"largest error {excess:.2e} m/s",
            "0.001 m/s",
        ),
        Check(
            "impulses at segment centres",
            misplaced <= TIME_TOLERANCE_DAYS,
            f"largest offset {misplaced:.2e} days",
            f"{TIME_TOLERANCE_DAYS:g} days",
        ),
    ]


def _check_arrivals(flown: FlownTour) -> list[Check]:
    misses_km, errors_m_s = [0.0], [0.0]
    for leg, arrival in zip(flown.legs, flown.arrivals, strict=True):
        if arrival is None:
            continue
        miss = arrival.reached - arrival.target
        misses_km.append(float(np.linalg.norm(miss[:3])) / 1e3)
        errors_m_s.append(float(np.linalg.norm(miss[3:] - leg.arr_velocity_m_s)))
    return [
        Check(
            "position at each arrival",
            max(misses_km) <= POSITION_TOLERANCE_KM,
            f"largest miss {max(misses_km):.3f} km",
            f"{POSITION_TOLERANCE_KM:g} km",
        ),
        Check(
            "velocity at each arrival",
            max(errors_m_s) <= VELOCITY_TOLERANCE_M_S,
            f"largest error {max(errors_m_s):.6f} m/s",
            f"{VELOCITY_TOLERANCE_M_S:g} m/s",
        ),
    ]


def _check_score(tour: Tour) -> Check:
    rule = tour.rules.score
    score = rule.score(tour.visits, tour.legs)
    return Check(
        "score",
        abs(tour.score - score) <= _SCORE_TOLERANCE * max(1.0, abs(score)),
        f"{tour.score:.6f}",
        f"{score:.6f} {rule.unit}".rstrip(),
    )


def _check_elements(tour: Tour, table: ElementTable) -> Check:
    # The body of a launch is no asteroid: its event has the elements of the problem statement.
    worst = 0.0
    for body in tour.visits:
        row = int(table.rows_of([body.id])[0])
        angles = [body.i_rad, body.node_rad, body.argp_rad, body.mean_anomaly_rad]
        ours = np.array([body.a_m / AU, body.e, *angles, body.epoch_mjd2000])
        elements = table.elements[row] / np.array([AU, 1, 1, 1, 1, 1])
        theirs = np.append(elements, table.epoch_mjd2000[row])
        worst = max(worst, float(np.abs(ours - theirs).max()))
    return Check(
        "elements as in the table",
        worst <= _ELEMENT_TOLERANCE,
        f"largest difference {worst:.1e}",
        f"{_ELEMENT_TOLERANCE:g}",
    )
