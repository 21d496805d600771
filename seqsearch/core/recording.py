"""From the search tree to a tour: the record of a node and what leads to it."""

from typing import Final

import numpy as np
from msgspec import UNSET, UnsetType
from numpy.typing import NDArray

from feasibility.orbits import Catalogue
from feasibility.sims_flanagan.mass_convention import segment_masses, throttles_to_impulses
from seqsearch.core.problem import Problem
from seqsearch.core.tree import FlownLeg, SearchTree
from seqsearch.tours.records import (
    LARGEST_M_STAR_KG,
    Impulse,
    State,
    TourBody,
    TourLeg,
)
from seqsearch.tours.tour import Tour

_REST_M_S: Final = 1e-6
"""Relative speed below which a spacecraft is at rest at a body."""


def record_tour(
    problem: Problem, tree: SearchTree, node: int, closing: tuple[FlownLeg, ...] = ()
) -> Tour:
    """Return the tour that leads to a node of the search tree, and on along closing legs.

    Nothing is solved here. Before the first node, -1, there is a tour without bodies.
    """
    rules = problem.tour_rules()
    if node < 0:
        start = problem.first_departure_mjd2000[0]
        return Tour(rules=rules, t_start_mjd2000=start, bodies=(), legs=(), score=0.0)
    flown = tree.legs_to(node)
    last = tree.node(node)
    rows = [flown[0].dep_row if flown else int(last["row"])]
    flown += closing
    rows += [leg.arr_row for leg in flown if leg.arr_row != leg.dep_row]
    bodies = tuple(tour_body(problem.catalogue, row) for row in rows)
    legs = tuple(_leg(problem, leg) for leg in flown)
    return Tour(
        rules=rules,
        t_start_mjd2000=flown[0].t_dep_mjd2000 if flown else float(last["t_mjd2000"]),
        bodies=bodies,
        legs=legs,
        score=rules.score.score(rules.visits(bodies), legs),
    )


def tour_body(catalogue: Catalogue, row: int) -> TourBody:
    """Return a body of a catalogue as tour files have it."""
    a, e, i, node, argp, anomaly = (float(value) for value in catalogue.elements[row])
    return TourBody(
        id=int(catalogue.ids[row]),
        name=catalogue.names[row],
        epoch_mjd2000=float(catalogue.epoch_mjd2000[row]),
        a_m=a,
        e=e,
        i_rad=i,
        node_rad=node,
        argp_rad=argp,
        mean_anomaly_rad=anomaly,
    )


def _leg(problem: Problem, leg: FlownLeg) -> TourLeg:
    return TourLeg(
        from_id=int(problem.catalogue.ids[leg.dep_row]),
        to_id=int(problem.catalogue.ids[leg.arr_row]),
        t_dep_mjd2000=leg.t_dep_mjd2000,
        tof_days=leg.tof_days,
        m0_kg=leg.m0,
        m_final_kg=leg.m_final,
        m_star_kg=min(leg.m_star, LARGEST_M_STAR_KG),
        impulses=_impulses(problem, leg),
        dep_velocity_m_s=_relative(problem, leg.dep_row, leg.t_dep_mjd2000, leg.rv_dep),
        arr_velocity_m_s=_relative(problem, leg.arr_row, leg.t_arr_mjd2000, leg.rv_arr),
        dropped_kg=leg.dropped,
        dep_body_state=_told(problem.catalogue, leg.dep_row, leg.t_dep_mjd2000),
        arr_body_state=_told(problem.catalogue, leg.arr_row, leg.t_arr_mjd2000),
    )


def _told(catalogue: Catalogue, row: int, t_mjd2000: float) -> State | UnsetType:
    """Return where a body is, if that does not follow from its elements."""
    if catalogue.ephemeris is None:
        return UNSET
    x, y, z, vx, vy, vz = (float(value) for value in catalogue.states_at([row], t_mjd2000)[0])
    return (x, y, z, vx, vy, vz)


def _relative(
    problem: Problem, row: int, t_mjd2000: float, rv: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return the velocity relative to a body, in m/s; exactly zero at rest."""
    velocity = rv[3:] - problem.catalogue.states_at([row], t_mjd2000)[0, 3:]
    if np.linalg.norm(velocity) < _REST_M_S:
        return (0.0, 0.0, 0.0)
    return (float(velocity[0]), float(velocity[1]), float(velocity[2]))


def _impulses(problem: Problem, leg: FlownLeg) -> tuple[Impulse, ...]:
    """Turn throttles into impulses, by the mass convention of the solvers."""
    n = len(leg.throttles)
    flown = (
        leg.throttles[None],
        np.array([leg.m0]),
        np.array([leg.m_final]),
        np.array([problem.spacecraft.thrust]),
        np.array([problem.spacecraft.exhaust_velocity]),
        np.array([leg.tof_days]),
    )
    dv = throttles_to_impulses(*flown)[0]
    before, after = (masses[0] for masses in segment_masses(*flown))
    centres = leg.t_dep_mjd2000 + (np.arange(n) + 0.5) * leg.tof_days / n
    return tuple(
        Impulse(
            t_mjd2000=float(centres[k]),
            dv_m_s=(float(dv[k, 0]), float(dv[k, 1]), float(dv[k, 2])),
            throttle=(
                float(leg.throttles[k, 0]),
                float(leg.throttles[k, 1]),
                float(leg.throttles[k, 2]),
            ),
            mass_before_kg=float(before[k]),
            mass_after_kg=float(after[k]),
        )
        for k in range(n)
    )
