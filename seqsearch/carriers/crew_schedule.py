"""From a crew to the schedule of its mother ship: which impulses may serve which probe."""

from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np

from seqsearch.carriers.crew import MISSION_DAYS, TOUCH_DAYS, WAIT_DAYS, Crew
from seqsearch.carriers.flight import captures_of, changes_of, releases_of, route_of
from seqsearch.carriers.mother import Change
from seqsearch.carriers.plans import Screen
from seqsearch.carriers.schedule import Act, Schedule, Step

_FIRST_LEAD_DAYS: Final = 12.0
"""By how much an impulse comes before the release or capture that it is for, at first."""

_SHORT_DAYS: Final = 250.0
"""Time between captures on one orbit in which she does not move."""

_RESERVE_DAYS: Final = 15.0
"""By how much retiming may shift the release of a probe that stays at last for all its time."""


def schedule_of(screen: Screen, crew: Crew) -> Schedule | None:
    """Return what the mother ship of a crew may do; None where there is no time for it.

    She need not have the propellant for it.

    Up to the release of the probe that stays at the first orbit's asteroid she is there, and at
    the capture of the one that stays at each other orbit's. Before each other release and capture
    there is an impulse.
    """
    route = route_of(screen, crew)
    changes = changes_of(screen, crew) if crew.course is None else []
    if route is None or changes is None:
        return None
    rules = screen.rules
    if crew.course is None:
        # The plan's way leaves time for tours as long as they may be.
        earliest = max(captures_of(crew)) + _RESERVE_DAYS - rules.max_duration_days
        other = screen.cheapest_route(crew.plan.first, earliest, min(releases_of(crew)))
        route = other if other is not None and other.delta_v < route.delta_v else route
    count = len(crew.flights)
    if crew.course is None:
        stays = _stays(crew)
        begins, ends = _with_stays(crew, stays)
        releases = sorted(zip(begins, range(count), strict=True))
        steps = _release_steps(releases, stays[0])
        for orbit in range(1, len(crew.plan.orbits)):
            captures = [(ends[k], k) for k in range(count) if crew.plan.ends[k] == orbit]
            steps += _capture_steps(sorted(captures), stays[orbit], changes[orbit - 1])
    else:
        stays = crew.course.stays
        releases = sorted(zip(releases_of(crew), range(count), strict=True))
        captures = sorted(zip(captures_of(crew), range(count), strict=True))
        steps = _steps_again(crew, releases, captures)
    steps[0] = replace(steps[0], range_mjd2000=(route.second_mjd2000 + TOUCH_DAYS, np.inf))
    for number in stays[1:]:
        if number is not None:
            end = route.launch_mjd2000 + rules.max_duration_days
            steps = _with_late_capture(steps, crew, number, end)
    return Schedule(
        steps,
        screen.catalogue,
        crew.plan.orbits,
        rules,
        route,
        stays,
        [float(flight.mass[-1]) for flight in crew.flights],
    )


_Epochs = list[tuple[float, int]]
_Stays = tuple[int | None, ...]


def _stays(crew: Crew) -> _Stays:
    """Return which probes had best stay: those released first and caught first.

    Then she is free to serve the others. As many stay as `Crew.waits` says.
    """
    wanted = crew.waits()
    begins, ends = _with_stays(crew, (None,) * len(wanted))
    best, earliest = wanted, (np.inf,) * len(wanted)
    ways = [_others(crew, orbit, probe) for orbit, probe in enumerate(wanted)]
    for stays in product(*ways):
        released, caught = _with_stays(crew, stays)
        if max(b - a for a, b in zip(released, caught, strict=True)) > MISSION_DAYS:
            continue
        when = tuple(
            -np.inf if probe is None else (ends if orbit else begins)[probe]
            for orbit, probe in enumerate(stays)
        )
        if when < earliest:
            best, earliest = stays, when
    return best


def _others(crew: Crew, orbit: int, probe: int | None) -> list[int | None]:
    if probe is None:
        return [None]
    return [k for k, end in enumerate(crew.plan.ends) if orbit in (0, end)]


def _with_stays(crew: Crew, stays: _Stays) -> tuple[list[float], list[float]]:
    """Return the epochs of all releases and captures if some probes stay."""
    begins = [float(flight.itinerary.t_dep_mjd2000[0]) for flight in crew.flights]
    ends = [float(flight.itinerary.t_arr_mjd2000[-1]) for flight in crew.flights]
    for orbit, probe in enumerate(stays):
        if probe is not None and orbit == 0:
            begins[probe] -= WAIT_DAYS
        elif probe is not None:
            ends[probe] += WAIT_DAYS
    return begins, ends


def _release_steps(releases: _Epochs, stay: int | None) -> list[Step]:
    """Return the steps of a mother ship that releases all probes on her first orbit so far."""
    steps: list[Step] = []
    kept = -1 if stay is None else [number for _, number in releases].index(stay)
    for k, (epoch, number) in enumerate(releases):
        if k > kept:
            steps.append(Step(Act.IMPULSE, epoch - _FIRST_LEAD_DAYS))
        steps.append(Step(Act.RELEASE, epoch, number, free=k > kept, stays=k == kept))
    return steps


def _capture_steps(captures: _Epochs, stay: int | None, change: Change) -> list[Step]:
    """Return the steps of a mother ship that goes on to an orbit and catches some probes there."""
    leave, arrive = change.impulses
    order = [number for _, number in captures]
    before = 0 if stay is None else order.index(stay)
    # So little time before she has to be at rest that she had better be so for all.
    resting = before if captures[before][0] - captures[0][0] < _SHORT_DAYS else 0
    before -= resting
    steps: list[Step] = []
    if before == 0:
        steps.append(Step(Act.DEPART, leave.t_mjd2000))
        steps.append(Step(Act.ARRIVE, arrive.t_mjd2000))
    else:
        steps.append(Step(Act.IMPULSE, leave.t_mjd2000, dv_m_s=leave.dv_m_s))
    for k, (epoch, number) in enumerate(captures):
        if k == before and k > 0:
            earlier = captures[k - 1][0]
            steps.append(Step(Act.DEPART, earlier + 0.1 * (epoch - earlier)))
            steps.append(Step(Act.ARRIVE, earlier + 0.9 * (epoch - earlier)))
        rests = number == stay
        if k == 0 and before > 0:
            steps.append(Step(Act.IMPULSE, arrive.t_mjd2000, dv_m_s=arrive.dv_m_s))
        elif not rests and k >= resting:
            steps.append(Step(Act.IMPULSE, epoch - _FIRST_LEAD_DAYS))
        steps.append(Step(Act.CAPTURE, epoch, number, stays=rests))
    return steps


def _steps_again(crew: Crew, releases: _Epochs, captures: _Epochs) -> list[Step]:
    """Return the steps of a mother ship that is on a course already."""
    course = crew.course
    assert course is not None
    events = [
        *[(epoch, Act.RELEASE, number) for epoch, number in releases],
        *[(epoch, Act.CAPTURE, number) for epoch, number in captures],
    ]
    steps = []
    for epoch, act, number in events:
        away = act is Act.CAPTURE or course.starts[number] > 0
        orbit = 0 if act is Act.RELEASE else crew.plan.ends[number]
        stays = number == course.stays[orbit]
        steps.append(Step(act, epoch, number, free=away, stays=stays))
    for k, impulse in enumerate(course.impulses, 1):
        if k + 1 in course.settled:
            steps.append(Step(Act.DEPART, impulse.t_mjd2000))
        elif k in course.settled:
            steps.append(Step(Act.ARRIVE, impulse.t_mjd2000))
        else:
            steps.append(Step(Act.IMPULSE, impulse.t_mjd2000, dv_m_s=impulse.dv_m_s))
    return sorted(steps, key=lambda step: step.t_mjd2000)


def _with_late_capture(
    steps: list[Step], crew: Crew, number: int, end_mjd2000: float
) -> list[Step]:
    """Return the steps with the range of when the probe is caught that stays at last.

    It may stay for all of the time that it has left.
    """
    released = next(step for step in steps if step.probe == number and step.act is Act.RELEASE)
    reserve = _RESERVE_DAYS if released.free and not released.stays else TOUCH_DAYS
    latest = released.t_mjd2000 + MISSION_DAYS - reserve
    earliest = float(crew.flights[number].itinerary.t_arr_mjd2000[-1]) + WAIT_DAYS
    return [
        replace(step, range_mjd2000=(earliest, max(earliest, min(latest, end_mjd2000))))
        if step.probe == number and step.act is Act.CAPTURE
        else step
        for step in steps
    ]
