"""Tours that no search had to find: legs that end at bodies because the bodies were put there."""

import numpy as np

from feasibility.constants import AU, DAY_S, G0, MU_SUN
from feasibility.orbits.classical import cartesian_to_classical
from feasibility.orbits.kepler_kernels import propagate_batch
from seqsearch import Tour, read_config
from seqsearch.beam.counters import RankCounters
from seqsearch.pruning.audit_estimate import AuditedHop, RankAudit, Stratum
from seqsearch.runs.run_folder import RunFolder
from seqsearch.tours.motion import body_state
from seqsearch.tours.paths import body_states
from seqsearch.tours.records import Impulse, TourBody, TourLeg
from seqsearch.tours.tour import TourRules
from seqsearch.tours.trajectory import Phase, Trajectory

_THRUST, _ISP, _SEGMENTS = 0.3, 3000.0, 10


def handmade_tour(
    names=("Alpha", "Beta", "Gamma", "Delta"), tof_days=120.0, stay_days=35.0, problem="handmade"
):
    """Return a tour of rendezvous that verifies: thrust along the path and against it in turn."""
    body = TourBody(
        id=11, name=names[0], epoch_mjd2000=7000.0, a_m=2.2 * AU, e=0.12, i_rad=0.1, node_rad=1.0,
        argp_rad=2.0, mean_anomaly_rad=0.5,
    )  # fmt: skip
    bodies, legs, t, mass = [body], [], 8000.25, 2000.0
    for k, name in enumerate(names[1:], 1):
        leg, state = _leg(bodies[-1], 11 + k, t, tof_days + 7 * k, mass)
        legs.append(leg)
        bodies.append(_body(state, leg.t_arr_mjd2000, 11 + k, name))
        t, mass = leg.t_arr_mjd2000 + stay_days, leg.m_final_kg
    rules = TourRules(
        name=problem, catalogue="a table", m0_kg=2000.0, m_dry_kg=800.0, thrust_n=_THRUST,
        isp_s=_ISP, first_departure_mjd2000=(7900.0, 8100.0), max_duration_days=1500.0,
        min_stay_days=30.0, start_ids=(),
    )  # fmt: skip
    return Tour(
        rules=rules, t_start_mjd2000=legs[0].t_dep_mjd2000 if legs else t, bodies=tuple(bodies),
        legs=tuple(legs), score=float(len(bodies)),
    )  # fmt: skip


def _leg(body, to_id, t_dep, tof_days, m0):
    segment = tof_days / _SEGMENTS
    state, t, mass, impulses = body_state(body, t_dep, MU_SUN), t_dep, m0, []
    for k in range(_SEGMENTS):
        epoch = t_dep + (k + 0.5) * segment
        state = _coast(state, epoch - t)
        # The engine rests in the middle of the leg, as it does where little thrust is needed.
        throttle = 0.0 if k in (4, 5) else 0.8
        after = mass
        for _ in range(50):
            dv = throttle * _THRUST * segment * DAY_S / (mass if k < _SEGMENTS // 2 else after)
            after = mass * np.exp(-dv / (_ISP * G0))
        along = (-1) ** to_id * state[3:] / np.linalg.norm(state[3:])
        impulses.append(
            Impulse(
                t_mjd2000=epoch, dv_m_s=tuple((dv * along).tolist()),
                throttle=tuple((throttle * along).tolist()), mass_before_kg=float(mass),
                mass_after_kg=float(after),
            )
        )  # fmt: skip
        state[3:] += dv * along
        t, mass = epoch, after
    leg = TourLeg(
        from_id=body.id, to_id=to_id, t_dep_mjd2000=t_dep, tof_days=tof_days, m0_kg=float(m0),
        m_final_kg=float(mass), m_star_kg=float(m0) * 1.04, impulses=tuple(impulses),
    )  # fmt: skip
    return leg, _coast(state, leg.t_arr_mjd2000 - t)


def _coast(state, days):
    return propagate_batch(state[None], np.array([days * DAY_S]), MU_SUN)[0]


def _body(state, epoch, body_id, name):
    a, e, i, node, argp, anomaly = cartesian_to_classical(state).tolist()
    return TourBody(
        id=body_id, name=name, epoch_mjd2000=epoch, a_m=a, e=e, i_rad=i, node_rad=node,
        argp_rad=argp, mean_anomaly_rad=anomaly,
    )  # fmt: skip


def handmade_run(folder, tour=None, ranks=4):
    """Write a run folder that no search made, with all that a report reads, and return it."""
    tour = tour or handmade_tour()
    rng = np.random.default_rng(5)
    strata = {
        "pruned": (Stratum(label="below 0.9", candidates=9e3, solved=40, flyable=1, far=True),),
        "kept": (Stratum(label="kept", candidates=60.0, solved=20, flyable=18),),
    }
    counters = []
    for rank in range(1, ranks + 1):
        hops = tuple(
            AuditedHop(
                kept=k % 3 == 0, tof_days=float(days), margin=float(margin), flyable=margin > 1.0
            )
            for k, (days, margin) in enumerate(rng.uniform([40, 0.3], [240, 1.5], (60, 2)))
        )
        counters.append(
            RankCounters(
                pass_number=1 + rank % 2, rank=rank, nodes=10, proposed=9060, optimised=60,
                pruned={"predictor": 8000, "default": 1000}, feasible=54, kept=10,
                audit=RankAudit(**strata, hops=hops),
            )
        )  # fmt: skip
    config = read_config("demo")
    run = RunFolder.create(folder, config, 7)
    run.write(tour, counters)
    return folder


def handmade_rows(tour, later_days=0.0):
    """Return rows of continuous thrust that fit in with a tour, though nothing could fly them.

    Arrivals are later than in the tour, as after refining.
    """
    phases = []
    for leg in tour.legs:
        t = np.linspace(leg.t_dep_mjd2000, leg.t_arr_mjd2000 + later_days, int(leg.tof_days) + 2)
        states = body_states(tour.body(leg.from_id), t, MU_SUN)
        thrust = np.zeros((len(t), 3))
        thrust[3:-3] = 0.2 * states[3:-3, 3:] / np.linalg.norm(states[3:-3, 3:], axis=1)[:, None]
        mass = np.linspace(leg.m0_kg, leg.m_final_kg + 1.0, len(t))
        phases.append(Phase(str(leg.from_id), str(leg.to_id), t, states, mass, thrust))
    return Trajectory(tuple(phases), continuous=True)
