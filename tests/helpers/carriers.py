"""A small carrier mission that keeps all rules: two craft, an asteroid each."""

import functools
import itertools

import numpy as np
from scipy.integrate import solve_ivp

from feasibility.constants import AU, DAY_S, G0, MJD2000_MJD, MU_SUN
from feasibility.continuous import ContinuousLeg, file_epoch, refine_leg
from feasibility.orbits import cartesian_to_classical
from seqsearch.carriers.campaign import CampaignSettings
from seqsearch.carriers.homing import HomingSettings
from seqsearch.tours.carrier.carrier_files import CARRIER, write_carrier
from seqsearch.tours.carrier.path import fly_carrier
from seqsearch.tours.carrier.records import (
    Carrier,
    CarrierImpulse,
    CarrierLaunch,
    CarrierRules,
    CraftCapture,
    CraftRelease,
    CraftRules,
)
from seqsearch.tours.paths import body_states
from seqsearch.tours.records import Impulse, TourBody, TourLeg
from seqsearch.tours.tour import Tour, TourRules
from seqsearch.tours.tour_files import to_json
from seqsearch.tours.trajectory import Phase, Trajectory
from seqsearch.tours.trajectory_files import write_trajectory
from tests.helpers.continuous import start_state

T_LAUNCH = 8000.0
NAMES = {1: "101", 2: "102"}
EXHAUST = 3000.0 * G0


def body(body_id, state, t_mjd2000):
    a, e, i, node, argp, anomaly = cartesian_to_classical(state[None])[0]
    return TourBody(
        id=body_id,
        name=f"body {body_id}",
        epoch_mjd2000=t_mjd2000,
        a_m=float(a),
        e=float(e),
        i_rad=float(i),
        node_rad=float(node),
        argp_rad=float(argp),
        mean_anomaly_rad=float(anomaly),
    )


def small_rules():
    return CarrierRules(
        name="small",
        planet=body(0, start_state(), T_LAUNCH),
        launch_mjd2000=(7990.0, 8010.0),
        v_inf_max_m_s=500.0,
        m0_kg=9000.0,
        m_dry_kg=2000.0,
        isp_s=900.0,
        max_impulses=3,
        max_duration_days=300.0,
        craft_count=2,
        craft=CraftRules(
            m0_kg=2000.0,
            m_dry_kg=1900.0,
            thrust_n=0.3,
            isp_s=3000.0,
            max_duration_days=200.0,
            min_stay_days=30.0,
        ),
    )


def _coasting_carrier():
    return Carrier(
        rules=small_rules(),
        events=(
            CarrierLaunch(t_mjd2000=T_LAUNCH, v_inf_m_s=(300.0, 400.0, 0.0)),
            CarrierImpulse(t_mjd2000=8010.25, dv_m_s=(0.0, 200.0, 100.0)),
            CraftRelease(t_mjd2000=8020.0, craft=1),
            CraftRelease(t_mjd2000=8030.5, craft=2),
            CarrierImpulse(t_mjd2000=8030.5, dv_m_s=(5.0, 0.0, 0.0)),
            CarrierImpulse(t_mjd2000=8190.0, dv_m_s=(0.0, 0.0, 8.0)),
            CraftCapture(t_mjd2000=8190.0, craft=1, mass_kg=1950.0),
            CraftCapture(t_mjd2000=8210.75, craft=2, mass_kg=1950.0),
        ),
    )


def _thrust_arc(state, begin, days, push_n):
    """Return epochs, states and masses of constant thrust over each of some days."""
    epochs = file_epoch(begin + np.arange(days + 1.0))
    states, masses = [state], [2000.0]
    for before, after in itertools.pairwise(epochs):
        flow = np.linalg.norm(push_n) / EXHAUST

        def motion(t, y, m=masses[-1], flow=flow):
            pull = -MU_SUN * y[:3] / np.linalg.norm(y[:3]) ** 3
            return np.concatenate([y[3:], pull + push_n / (m - flow * t)])

        dt = (after - before) * DAY_S
        scale = np.array([1e11] * 3 + [1e4] * 3)
        end = solve_ivp(
            motion, (0.0, dt), states[-1], method="DOP853", rtol=1e-12, atol=1e-13 * scale
        ).y[:, -1]
        states.append(end)
        masses.append(masses[-1] - flow * dt)
    return epochs, np.array(states), np.array(masses)


def _at_release(path, number):
    return path.after[path.carrier.events.index(path.carrier.release(number))]


def _craft(path, number, begin, end, push_n):
    """Return the rows of a craft, and the asteroid to which its thrust leads it."""
    epochs, states, masses = _thrust_arc(_at_release(path, number), begin, 50, np.array(push_n))
    thrust = np.tile(push_n, (len(epochs), 1))
    thrust[-1] = 0.0
    asteroid = body(int(NAMES[number]), states[-1], float(epochs[-1]))
    out = Phase("901", NAMES[number], epochs, states, masses, thrust)
    leaving = float(file_epoch(epochs[-1] + 31.0))
    leg = ContinuousLeg(
        departure=body_states(asteroid, [leaving], MU_SUN)[0],
        target=lambda t: path.states(t)[0],
        t_dep_mjd2000=leaving,
        m0_kg=float(masses[-1]),
        thrust_n=0.3,
        exhaust_velocity_m_s=EXHAUST,
    )
    arc = refine_leg(leg, end, np.zeros((8, 3)))
    assert arc.converged
    last = np.concatenate([arc.thrust_n, np.zeros((1, 3))])
    back = Phase(NAMES[number], "902", arc.edges_mjd2000, arc.states, arc.mass_kg, last)
    return Trajectory((out, back), continuous=True), asteroid


@functools.cache
def small_mission():
    """Return a carrier, the rows of its craft by number, and the asteroids by name."""
    carrier = _coasting_carrier()
    path = fly_carrier(carrier)
    one, first = _craft(path, 1, 8020.0, 8190.0, (0.02, 0.04, 0.0))
    two, second = _craft(path, 2, 8030.5, 8210.75, (-0.03, 0.0, 0.02))
    return carrier, {1: one, 2: two}, {"101": first, "102": second}


def write_mission_table(path):
    """Write the asteroids of the small mission as an asteroid table."""
    lines = ["ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)"]
    for one in small_mission()[2].values():
        angles = np.degrees([one.i_rad, one.node_rad, one.argp_rad, one.mean_anomaly_rad])
        numbers = (one.epoch_mjd2000 + MJD2000_MJD, one.a_m / AU, one.e, *angles)
        lines.append(f"{one.id} " + " ".join(f"{number:.17g}" for number in numbers))
    path.write_text("\n".join(lines) + "\n")


def write_carrier_run(folder):
    """Write the small mission as a run folder: the carrier, and a refined tour for each craft."""
    carrier, craft, bodies = small_mission()
    path = fly_carrier(carrier)
    write_carrier(carrier, folder / CARRIER)
    for number, rows in craft.items():
        ends = (
            path.release_orbit(number, body_id=901),
            bodies[NAMES[number]],
            path.capture_orbit(number, body_id=902),
        )
        tour = _tour(carrier.rules, rows, ends)
        own = folder / f"probe-{number}"
        own.mkdir()
        (own / "sequence.json").write_text(to_json(tour))
        write_trajectory(own, tour, rows, {})


def _tour(rules, rows, bodies):
    legs = []
    for phase, start, end in zip(rows.phases, bodies, bodies[1:], strict=False):
        begin, until = float(phase.t_mjd2000[0]), float(phase.t_mjd2000[-1])
        first, last = float(phase.mass_kg[0]), float(phase.mass_kg[-1])
        impulse = Impulse(
            t_mjd2000=0.5 * (begin + until),
            dv_m_s=(0.0, 0.0, 0.0),
            throttle=(0.0, 0.0, 0.0),
            mass_before_kg=first,
            mass_after_kg=last,
        )
        legs.append(
            TourLeg(
                from_id=start.id,
                to_id=end.id,
                t_dep_mjd2000=begin,
                tof_days=until - begin,
                m0_kg=first,
                m_final_kg=last,
                m_star_kg=2.0 * first,
                impulses=(impulse,),
            )
        )
    craft = rules.craft
    tour_rules = TourRules(
        name="small", catalogue="a table", m0_kg=craft.m0_kg, m_dry_kg=craft.m_dry_kg,
        thrust_n=craft.thrust_n, isp_s=craft.isp_s, first_departure_mjd2000=(7990.0, 8300.0),
        max_duration_days=craft.max_duration_days, min_stay_days=craft.min_stay_days,
        start_ids=(),
    )  # fmt: skip
    return Tour(
        rules=tour_rules, t_start_mjd2000=legs[0].t_dep_mjd2000, bodies=bodies,
        legs=tuple(legs), score=1.0,
    )  # fmt: skip


BELT_PROBLEM = """
[problem]
name = "gtoc7-full"

[spacecraft]
wet_mass_kg = 2000.0
dry_mass_kg = 800.0
thrust_n = 0.3
isp_s = 3000.0

[mission]
first_departure_mjd = [59215.0, 65058.0]
max_duration_days = 2191.5
min_stay_days = 30.0

[catalogue]
synthetic_bodies = 12000
synthetic_seed = 7

[search]
tof_days_min = 40.0
tof_days_max = 240.0
"""
"""A mother ship in a synthetic belt."""

TINY_CAMPAIGN = CampaignSettings(
    rated=4000,
    sifted=200,
    continued=1,
    chained=1,
    judged=2,
    varied=4,
    manned=2,
    improvements=4,
    crews=HomingSettings(width=100, results=2),
    launch_share=0.01,
)
"""Little of each stage."""
