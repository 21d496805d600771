"""`drawings`: the numbers that the page draws, as plain data."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU
from seqsearch.report.material import Material
from seqsearch.tours.bodies.told_motion import motion_of
from seqsearch.tours.dates import date_of
from seqsearch.tours.export.protocol import Flight
from seqsearch.tours.paths import orbit_points
from seqsearch.tours.pictures.stops import stops
from seqsearch.tours.tour import Tour
from seqsearch.tours.trajectory import Phase

_POINTS_A_LEG: Final = 160
_POINTS_AN_ORBIT: Final = 121
_POINTS_A_STAY: Final = 12
_AU_DIGITS: Final = 5


def drawings(material: Material) -> dict[str, Any]:
    """Return what the page's scripts get: finite numbers, and texts that they show as texts."""
    tour = material.tour
    return {
        "orbits": [_points(orbit_points(body, _POINTS_AN_ORBIT)) for body in _bodies(tour)],
        "stops": _stops(tour),
        "paths": []
        if material.flight is None
        else [*map(_path, material.flight.trajectory.phases)],
        "stays": _stays(tour),
        "thrust": [] if material.flight is None else _thrust(material.flight),
        "mass": [] if material.flight is None else _mass(material.flight),
        "limits": {"thrust_n": tour.rules.thrust_n, "dry_kg": tour.rules.m_dry_kg},
        "visits": _visits(tour),
        "ranks": [
            [
                line.pass_number,
                line.rank,
                line.proposed,
                line.pruned,
                line.optimised,
                line.feasible,
                line.kept,
            ]
            for line in material.ranks
        ],
        "candidates": [
            [round(line.tof_days, 1), line.margin, int(line.kept), int(line.flyable)]
            for line in material.candidates
            if line.margin is not None
        ],
    }


def _bodies(tour: Tour) -> list[Any]:
    """Return each body once."""
    return list({body.id: body for body in tour.bodies}.values())


def _points(positions_m: NDArray[np.float64]) -> list[list[float]]:
    rounded: list[list[float]] = np.round(positions_m / AU, _AU_DIGITS).tolist()
    return rounded


def _stops(tour: Tour) -> list[dict[str, Any]]:
    """Return where the tour starts and arrives, numbered as the legs."""
    found = []
    for stop in stops(tour):
        at = motion_of(tour, stop.body, [stop.t_mjd2000])[0, :3]
        found.append(
            {
                "number": stop.number,
                "name": stop.body.name or str(stop.body.id),
                "id": str(stop.body.id),
                "date": date_of(stop.t_mjd2000),
                "at": _points(at[None])[0],
            }
        )
    return found


def _stays(tour: Tour) -> list[list[list[float]]]:
    """Return the way of the bodies while the spacecraft is there."""
    return [
        _points(
            motion_of(
                tour,
                stop.body,
                np.linspace(stop.t_mjd2000, stop.t_mjd2000 + stop.stay_days, _POINTS_A_STAY),
            )[:, :3]
        )
        for stop in stops(tour)
        if stop.stay_days
    ]


def _path(phase: Phase) -> list[list[float]]:
    every = np.linspace(0, len(phase) - 1, min(len(phase), _POINTS_A_LEG)).astype(np.intp)
    return _points(phase.states[every, :3])


def _thrust(flight: Flight) -> list[list[list[float]]]:
    """Return for each leg steps of epoch and thrust in N, which holds until the next epoch."""
    if flight.trajectory.continuous:
        return [
            [
                [round(t, 3), round(force, 6)]
                for t, force in zip(
                    phase.t_mjd2000.tolist(),
                    np.linalg.norm(phase.thrust_n, axis=1).tolist(),
                    strict=True,
                )
            ]
            for phase in flight.trajectory.phases
        ]
    legs = []
    for leg in flight.tour.legs:
        edges = np.linspace(leg.t_dep_mjd2000, leg.t_arr_mjd2000, len(leg.impulses) + 1).tolist()
        force = [
            flight.tour.rules.thrust_n * float(np.linalg.norm(impulse.throttle))
            for impulse in leg.impulses
        ]
        steps = zip(edges, [*force, 0.0], strict=True)
        legs.append([[round(t, 3), round(n, 6)] for t, n in steps])
    return legs


def _mass(flight: Flight) -> list[list[float]]:
    """Return epochs and masses in kg; what is left behind shows as a step at the arrival."""
    line = []
    phases = flight.trajectory.phases
    after = [float(phase.mass_kg[0]) for phase in phases[1:]]
    after.append(float(phases[-1].mass_kg[-1]) - flight.tour.legs[-1].dropped_kg)
    for phase, left_kg in zip(phases, after, strict=True):
        every = np.unique(
            np.linspace(0, len(phase) - 1, min(len(phase), _POINTS_A_LEG)).astype(np.intp)
        )
        line += [
            [round(t, 3), round(kg, 4)]
            for t, kg in zip(
                phase.t_mjd2000[every].tolist(), phase.mass_kg[every].tolist(), strict=True
            )
        ]
        line.append([round(float(phase.t_mjd2000[-1]), 3), round(left_kg, 4)])
    return line


def _visits(tour: Tour) -> list[dict[str, Any]]:
    """Return for each leg when it flies and until when the stay after it lasts."""
    following = [leg.t_dep_mjd2000 for leg in tour.legs[1:]]
    return [
        {
            "number": number,
            "name": tour.body(leg.to_id).name or str(leg.to_id),
            "departure": round(leg.t_dep_mjd2000, 3),
            "arrival": round(leg.t_arr_mjd2000, 3),
            "until": round(until, 3),
            "fly_by": leg.is_fly_by,
        }
        for number, (leg, until) in enumerate(
            zip(
                tour.legs,
                [*following, *(leg.t_arr_mjd2000 for leg in tour.legs[-1:])],
                strict=True,
            ),
            1,
        )
    ]
