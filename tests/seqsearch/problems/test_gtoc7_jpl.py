"""JPL's three sequences of GTOC7, flown from and to the mother ship at the published times."""

import csv
from itertools import pairwise

import numpy as np
import pytest

from feasibility.constants import DAY_S, G0, MU_SUN
from feasibility.continuous import ContinuousLeg, file_epoch, refine_leg
from feasibility.legs import Legs
from feasibility.orbits import read_catalogue
from feasibility.sims_flanagan.solve import max_initial_mass, optimise
from seqsearch.core.recording import tour_body
from seqsearch.tours.carrier.carrier_files import read_carrier
from seqsearch.tours.carrier.path import fly_carrier
from seqsearch.tours.carrier.reading import read_carrier_files
from seqsearch.tours.carrier.rows import write_carrier_rows
from seqsearch.tours.carrier.verify import verify_carrier
from seqsearch.tours.paths import body_states
from seqsearch.tours.trajectory import Phase, Trajectory
from tests.helpers.gtoc7 import RECONSTRUCTION

pytestmark = pytest.mark.slow

CRAFT = {"thrust": 0.3, "isp": 3000.0, "m_dry": 600.0}
EXHAUST = 3000.0 * G0
DELAYS = (0.0, 0.5, 1.0, 2.0)
"""Days by which an arrival may be late where the published masses, to which we add a little, leave
too little margin."""


def _arrival(start, end, t_dep, t_arr, mass, fixed):
    """Return the first arrival that can be flown with some margin, and the leg's solution."""
    for delay in (0.0,) if fixed else DELAYS:
        epoch = float(file_epoch(t_arr + delay))
        leg = Legs(
            rv_dep=body_states(start, [t_dep], MU_SUN),
            rv_arr=body_states(end, [epoch], MU_SUN),
            tof_days=[epoch - t_dep],
            m0=[mass],
            **CRAFT,
        )
        if max_initial_mass(leg)[0] >= 1.002 * mass:
            break
    return epoch, leg, optimise(leg)


def _flown(start, end, t_dep, t_arr, mass, fixed):
    t_arr, leg, solved = _arrival(start, end, t_dep, t_arr, mass, fixed)
    assert solved.converged[0], f"{start.id} -> {end.id}"
    throttles = solved.throttles[0]
    segment_s = (t_arr - t_dep) * DAY_S / len(throttles)
    impulses, m = [], mass
    for throttle in throttles:
        impulses.append(0.3 * segment_s * throttle / m)
        m *= np.exp(-np.linalg.norm(impulses[-1]) / EXHAUST)
    arc = refine_leg(
        ContinuousLeg(
            departure=leg.rv_dep[0],
            target=lambda t: body_states(end, [t], MU_SUN)[0],
            t_dep_mjd2000=t_dep,
            m0_kg=mass,
            thrust_n=0.3,
            exhaust_velocity_m_s=EXHAUST,
        ),
        t_arr,
        throttles,
        impulses_m_s=np.array(impulses),
    )
    assert arc.converged, f"{start.id} -> {end.id}"
    thrust = np.concatenate([arc.thrust_n, np.zeros((1, 3))])
    return Phase(str(start.id), str(end.id), arc.edges_mjd2000, arc.states, arc.mass_kg, thrust)


def _craft(craft, carrier, rows, bodies):
    """Return the rows of a craft: departures as late as published, arrivals as published."""
    path = fly_carrier(carrier)
    begin = carrier.release(craft).t_mjd2000
    own = [row for row in rows if row["probe"] == str(craft)]
    stops = [path.release_orbit(craft, body_id=-1)]
    stops += [bodies[row["asteroid_id"]] for row in own[1:-1]]
    stops.append(path.capture_orbit(craft, body_id=-2))
    phases, mass, t_dep = [], 2000.0, float(file_epoch(begin))
    for k, ((start, end), row) in enumerate(zip(pairwise(stops), own[1:], strict=True)):
        last = k == len(stops) - 2
        t_arr = begin + float(row["tof_since_probe_release_d"])
        if last:
            t_arr = carrier.capture(craft).t_mjd2000
        phases.append(_flown(start, end, t_dep, t_arr, mass, last))
        mass, reached = float(phases[-1].mass_kg[-1]), float(phases[-1].t_mjd2000[-1])
        # A tenth of a second more than the stay, so that files keep it.
        t_dep = float(file_epoch(max(t_arr + float(row["stay_d"]), reached + 30.0 + 1e-6)))
    return Trajectory(tuple(phases), continuous=True)


def test_all_of_jpls_tour_is_flown_and_verified_from_its_files(shared, tmp_path):
    carrier = read_carrier(RECONSTRUCTION)
    table = read_catalogue(shared / "gtoc" / "official" / "GTOC7-DATA.txt")
    with (shared / "legs" / "gtoc7_jpl_36.csv").open() as file:
        rows = list(csv.DictReader(file))
    names = {row["asteroid_id"] for row in rows if row["asteroid_id"].isdigit()}
    bodies = {name: tour_body(table, int(table.rows_of([int(name)])[0])) for name in names}
    craft = {number: _craft(number, carrier, rows, bodies) for number in (1, 2, 3)}
    write_carrier_rows(tmp_path, carrier, craft)
    outcome = verify_carrier(read_carrier_files(tmp_path), bodies, carrier.rules)
    assert [check for check in outcome.checks if not check.passed] == []
    found = outcome.checks[-1].found
    assert found.startswith("36 asteroids")
    # JPL had 2450.257 kg.
    assert float(found.split()[3]) == pytest.approx(2458.0, abs=4.0)
