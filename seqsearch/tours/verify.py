"""Independent verification of a tour.

Nothing here is shared with the leg solver or the search, neither code nor imports: bodies are
propagated by solving Kepler's equation with scipy, or are where SPICE says that they are by the
kernels of the problem, legs by integrating the equations of motion with scipy's DOP853 between
impulses, and every rule of the problem is checked again from the numbers in ``sequence.json``.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final, Protocol

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import AU
from feasibility.errors import InputError
from seqsearch.tours.bodies.kernel_states import kernel_states, missing_kernels
from seqsearch.tours.checks import (
    SPEED_TOLERANCE_M_S,
    TIME_TOLERANCE_DAYS,
    Arrival,
    Check,
    FlownTour,
    Verification,
    largest,
    smallest,
    visited_ids,
)
from seqsearch.tours.ends import check_ends, visited_twice
from seqsearch.tours.events.make import event_kinds
from seqsearch.tours.model_checks import check_masses, check_thrust
from seqsearch.tours.motion import (
    arrival_state,
    body_state,
    departure_state,
    fly_from,
)
from seqsearch.tours.tour import Tour, TourRules

POSITION_TOLERANCE_KM: Final = 1000.0
"""Largest miss distance at arrival (GTOC5, GTOC7 and GTOC12 problem statements)."""

VELOCITY_TOLERANCE_M_S: Final = 1.0
"""Largest velocity error at arrival (GTOC5, GTOC7 and GTOC12 problem statements)."""

_BODY_TOLERANCE_M: Final = 1.0
_BODY_TOLERANCE_M_S: Final = 1e-3
"""How far bodies in a tour's file may be from where its kernels say that they are."""

_States = Callable[[int, float], NDArray[np.float64]]
"""The (6,) state of a body, m and m/s, by id and epoch in MJD2000."""

_ELEMENT_TOLERANCE: Final = 1e-12
_SCORE_TOLERANCE: Final = 1e-9


class ElementTable(Protocol):
    """The bodies of an asteroid table; `feasibility.orbits.Catalogue` is one."""

    @property
    def names(self) -> Sequence[str]: ...  # noqa: D102
    @property
    def epoch_mjd2000(self) -> NDArray[np.float64]: ...  # noqa: D102
    @property
    def elements(self) -> NDArray[np.float64]: ...  # noqa: D102

    def rows_of(self, ids: ArrayLike, /) -> NDArray[np.int64]:
        """Return the rows of ids."""
        ...


def verify_tour(
    tour: Tour,
    catalogue: ElementTable | None = None,
    rules: TourRules | None = None,
    kernels: Sequence[Path] = (),
) -> Verification:
    """Check a tour against its rules and the laws of motion.

    Parameters
    ----------
    tour : Tour
        The tour, as read from ``sequence.json``.
    catalogue : ElementTable, optional
        If given, the bodies of the tour are compared with those of the table, by id.
    rules : TourRules, optional
        What the tour has to respect; default: what its own file says, which proves little
        where the file may have been changed.
    kernels : sequence of Path
        SPK kernels, for rules by which the bodies move as kernels say. Without those very files
        the tour is not verified.

    Returns
    -------
    Verification
        All checks.
    """
    if rules is not None:
        tour = msgspec.structs.replace(tour, rules=rules)
    if not tour.legs:
        return Verification((Check("at least one leg", False, "0", "1"),))
    checks = [*_check_order(tour), *_check_times(tour), *check_masses(tour), *check_thrust(tour)]
    arrivals, of_bodies = _flown(tour, kernels)
    flown = FlownTour(tour.bodies, tour.legs, arrivals)
    checks += [*of_bodies, *_check_arrivals(flown)]
    given = {type(event) for event in tour.rules.events}
    absent = (kind.forbidden() for kind in event_kinds().values() if kind not in given)
    for event in (*tour.rules.events, *absent):
        if event is not None:
            checks += event.checks(flown)
    checks.append(_check_score(tour))
    if catalogue is not None:
        checks.append(_check_elements(tour, catalogue))
    return Verification(tuple(checks))


def _flown(
    tour: Tour, kernels: Sequence[Path]
) -> tuple[tuple[Arrival | None, ...], tuple[Check, ...]]:
    """Integrate every leg between bodies as the rules let them move, and check these bodies."""
    asked = tour.rules.kernels
    if not asked:
        mu = tour.rules.mu_m3_s2
        bodies = {body.id: body for body in tour.bodies}
        arrivals = _arrivals(tour, lambda body, t: body_state(bodies[body], t, mu))
        return arrivals, _told(tour)
    names = ", ".join(kernel.name for kernel in asked)
    missing = missing_kernels(asked, kernels)
    there = Check(
        "kernels of the bodies at hand",
        not missing,
        f"missing or changed: {', '.join(missing)}" if missing else "the same files",
        names,
    )
    nothing: tuple[Arrival | None, ...] = (None,) * len(tour.legs)
    if missing:
        return nothing, (there, Check("arrivals against the kernels", False, "not checked", names))
    try:
        with kernel_states(kernels) as states:
            return _arrivals(tour, states), (there, _check_bodies(tour, states))
    except InputError as error:
        return nothing, (there, Check("arrivals against the kernels", False, str(error), names))


def _told(tour: Tour) -> tuple[Check, ...]:
    """Fail a tour whose bodies do not move by their elements, though the rules know no kernel."""
    if not any(leg.dep_body_state or leg.arr_body_state for leg in tour.legs):
        return ()
    return (Check("bodies move by their elements", False, "states of their own", "Kepler orbits"),)


def _arrivals(tour: Tour, states: _States) -> tuple[Arrival | None, ...]:
    """Integrate every leg; None where a body is missing, which the check of the order finds."""
    mu = tour.rules.mu_m3_s2
    known = {body.id for body in tour.bodies}
    return tuple(
        Arrival(
            fly_from(leg, states(leg.from_id, leg.t_dep_mjd2000), mu),
            states(leg.to_id, leg.t_arr_mjd2000),
        )
        if {leg.from_id, leg.to_id} <= known
        else None
        for leg in tour.legs
    )


def _check_bodies(tour: Tour, states: _States) -> Check:
    """Check the states of bodies that the file has, from which others draw and export the tour."""
    mu = tour.rules.mu_m3_s2
    bodies = {body.id: body for body in tour.bodies}
    off = [np.zeros(6)]
    for leg in tour.legs:
        for body, epoch, state in (
            (leg.from_id, leg.t_dep_mjd2000, departure_state),
            (leg.to_id, leg.t_arr_mjd2000, arrival_state),
        ):
            if body in bodies:
                off.append(state(leg, bodies[body], mu) - states(body, epoch))
    worst_m = largest(float(np.linalg.norm(error[:3])) for error in off)
    worst_m_s = largest(float(np.linalg.norm(error[3:])) for error in off)
    return Check(
        "bodies where the kernels say",
        worst_m <= _BODY_TOLERANCE_M and worst_m_s <= _BODY_TOLERANCE_M_S,
        f"largest error {worst_m:.3f} m, {1e3 * worst_m_s:.4f} mm/s",
        f"{_BODY_TOLERANCE_M:g} m, {1e3 * _BODY_TOLERANCE_M_S:g} mm/s",
    )


def _check_order(tour: Tour) -> list[Check]:
    ids = [body.id for body in tour.bodies]
    chain = [(leg.from_id, leg.to_id) for leg in tour.legs]
    stops = [ids[0], *visited_ids(tour.legs)]
    places = [ids[0], *(leg.to_id for leg in tour.legs)]
    linked = chain == list(pairwise(places)) and stops == ids
    repeated = visited_twice(tour.rules, ids)
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
        *check_ends(tour.rules, tour.bodies),
    ]


def _check_times(tour: Tour) -> list[Check]:
    rules = tour.rules
    earliest, latest = rules.first_departure_mjd2000
    departure = tour.legs[0].t_dep_mjd2000 if tour.legs else tour.t_start_mjd2000
    outside = largest([earliest - departure, departure - latest])
    stays = [
        following.t_dep_mjd2000 - leg.t_arr_mjd2000
        for leg, following in pairwise(tour.legs)
        if not leg.is_fly_by
    ]
    shortest = smallest(stays)
    positive = all(leg.tof_days > 0 for leg in tour.legs)
    jump = largest(
        float(np.linalg.norm(np.subtract(following.dep_velocity_m_s, leg.arr_velocity_m_s)))
        for leg, following in pairwise(tour.legs)
    )
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


def _check_arrivals(flown: FlownTour) -> list[Check]:
    misses_km, errors_m_s = [], []
    for leg, arrival in zip(flown.legs, flown.arrivals, strict=True):
        if arrival is None:
            continue
        miss = arrival.reached - arrival.target
        misses_km.append(float(np.linalg.norm(miss[:3])) / 1e3)
        errors_m_s.append(float(np.linalg.norm(miss[3:] - leg.arr_velocity_m_s)))
    miss_km, error_m_s = largest(misses_km), largest(errors_m_s)
    return [
        Check(
            "position at each arrival",
            miss_km <= POSITION_TOLERANCE_KM,
            f"largest miss {miss_km:.3f} km",
            f"{POSITION_TOLERANCE_KM:g} km",
        ),
        Check(
            "velocity at each arrival",
            error_m_s <= VELOCITY_TOLERANCE_M_S,
            f"largest error {error_m_s:.6f} m/s",
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
    differences, strangers = [], []
    for body in tour.visits:
        try:
            row = int(table.rows_of([body.id])[0])
        except InputError:
            strangers.append(body.id)
            continue
        angles = [body.i_rad, body.node_rad, body.argp_rad, body.mean_anomaly_rad]
        ours = np.array([body.a_m / AU, body.e, *angles, body.epoch_mjd2000])
        elements = table.elements[row] / np.array([AU, 1, 1, 1, 1, 1])
        theirs = np.append(elements, table.epoch_mjd2000[row])
        differences.append(float(np.abs(ours - theirs).max()))
        if body.name != table.names[row]:
            strangers.append(body.id)
    worst = largest(differences)
    found = f"largest difference {worst:.1e}"
    return Check(
        "elements as in the table",
        worst <= _ELEMENT_TOLERANCE and not strangers,
        f"{found}, unlike or missing {strangers}" if strangers else found,
        f"{_ELEMENT_TOLERANCE:g}, same ids and names",
    )
