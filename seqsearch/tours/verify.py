"""Independent verification of a tour.

Nothing here is shared with the leg solver or the search: bodies are propagated
by solving Kepler's equation with scipy, legs by integrating the equations of
motion with scipy's DOP853 between impulses, and every rule of the problem is
checked again from the numbers in ``sequence.json``.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import newton
from scipy.spatial.transform import Rotation

from feasibility.constants import AU, DAY_S
from feasibility.orbits import Catalogue, earth
from seqsearch.tours.tour import Tour, TourBody, TourLeg, TourRules

POSITION_TOLERANCE_KM: Final = 1000.0
"""Largest miss distance at arrival (GTOC5, GTOC7 and GTOC12 problem statements)."""

VELOCITY_TOLERANCE_M_S: Final = 1.0
"""Largest velocity error at arrival (GTOC5, GTOC7 and GTOC12 problem statements)."""

_MASS_TOLERANCE_KG = 0.01
_SPEED_TOLERANCE_M_S = 1e-6
_THROTTLE_TOLERANCE = 1e-6
_TIME_TOLERANCE_DAYS = 1e-6
_ELEMENT_TOLERANCE = 1e-12


@final
@dataclass(frozen=True)
class Check:
    """One rule and how well the tour keeps it.

    Attributes
    ----------
    name : str
        What was checked.
    passed : bool
        Whether it holds.
    found, limit : str
        The worst value and what is allowed, with units.
    """

    name: str
    passed: bool
    found: str
    limit: str


@final
@dataclass(frozen=True)
class Verification:
    """The outcome of all checks; `passed` if every one holds."""

    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Whether every check holds."""
        return all(check.passed for check in self.checks)

    def table(self) -> str:
        """Return the checks as a text table."""
        width = max(len(check.name) for check in self.checks)
        return "\n".join(
            f"{'ok  ' if check.passed else 'FAIL'}  {check.name:<{width}}  "
            f"{check.found}  (limit: {check.limit})"
            for check in self.checks
        )


def verify_tour(tour: Tour, catalogue: Catalogue | None = None) -> Verification:
    """Check a tour against its rules and the laws of motion.

    Parameters
    ----------
    tour : Tour
        The tour, as read from ``sequence.json``.
    catalogue : Catalogue, optional
        If given, the elements in the tour are compared with the table's own.

    Returns
    -------
    Verification
        All checks; a tour without legs passes if its start is allowed.
    """
    checks = [*_check_order(tour), *_check_velocities(tour), *_check_times(tour)]
    checks += [*_check_masses(tour), *_check_thrust(tour), *_check_arrivals(tour)]
    if catalogue is not None:
        checks.append(_check_elements(tour, catalogue))
    return Verification(tuple(checks))


def _check_order(tour: Tour) -> list[Check]:
    ids = [body.id for body in tour.bodies]
    chain = [(leg.from_id, leg.to_id) for leg in tour.legs]
    stops = [ids[0], *(leg.to_id for leg in tour.legs if not leg.is_fly_by)]
    places = [ids[0], *(leg.to_id for leg in tour.legs)]
    linked = chain == list(pairwise(places)) and stops == ids
    repeated = sorted({body for body in ids if ids.count(body) > 1})
    start_ids = tour.rules.start_ids
    astray = _astray_fly_bys(tour)
    return [
        Check(
            "legs join the bodies in order", linked, "joined" if linked else str(chain), "joined"
        ),
        Check("no body twice", not repeated, str(repeated) if repeated else "none", "none"),
        Check(
            "fly-bys of bodies met before, once each",
            not astray,
            str(astray) if astray else "all",
            "all" if tour.rules.gtoc5 is not None else "no fly-bys",
        ),
        Check(
            "start body allowed",
            not start_ids or ids[0] in start_ids,
            str(ids[0]),
            str(list(start_ids)) if start_ids else "any",
        ),
    ]


def _astray_fly_bys(tour: Tour) -> list[int]:
    """Return the bodies of fly-bys that the rules do not allow."""
    fly_bys = [(k, leg.to_id) for k, leg in enumerate(tour.legs) if leg.is_fly_by]
    if tour.rules.gtoc5 is None:
        return [body for _, body in fly_bys]
    astray, passed = [], set()
    for k, body in fly_bys:
        met = any(leg.to_id == body and not leg.is_fly_by for leg in tour.legs[:k])
        if not met or body in passed:
            astray.append(body)
        passed.add(body)
    return astray


def _check_velocities(tour: Tour) -> list[Check]:
    """Check where velocities relative to bodies come from: the launch, or the fly-by before."""
    rules = tour.rules.gtoc5
    launch = float(np.linalg.norm(tour.legs[0].dep_velocity_m_s)) if tour.legs else 0.0
    most = 0.0 if rules is None else rules.launch_speed_max_m_s
    jump, wait = 0.0, 0.0
    for leg, following in pairwise(tour.legs):
        change = np.subtract(following.dep_velocity_m_s, leg.arr_velocity_m_s)
        jump = max(jump, float(np.linalg.norm(change)))
        if leg.is_fly_by:
            wait = max(wait, abs(following.t_dep_mjd2000 - leg.t_arr_mjd2000))
    return [
        Check(
            "launch speed",
            launch <= most + _SPEED_TOLERANCE_M_S,
            f"{launch:.6f} m/s",
            f"{most:g} m/s",
        ),
        Check(
            "velocity continuous along the tour",
            jump <= _SPEED_TOLERANCE_M_S,
            f"largest jump {jump:.2e} m/s",
            f"{_SPEED_TOLERANCE_M_S:g} m/s",
        ),
        Check(
            "no stay after a fly-by",
            wait <= _TIME_TOLERANCE_DAYS,
            f"longest {wait:.2e} days",
            f"{_TIME_TOLERANCE_DAYS:g} days",
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
    return [
        Check(
            "first departure in the window",
            outside <= _TIME_TOLERANCE_DAYS,
            f"{departure:.3f} MJD2000",
            f"{earliest:.3f} to {latest:.3f}",
        ),
        Check(
            "duration",
            positive and tour.duration_days <= rules.max_duration_days + _TIME_TOLERANCE_DAYS,
            f"{tour.duration_days:.3f} days",
            f"{rules.max_duration_days:.3f} days",
        ),
        Check(
            "stays",
            shortest >= rules.min_stay_days - _TIME_TOLERANCE_DAYS,
            f"{shortest:.3f} days",
            f"at least {rules.min_stay_days:.3f} days",
        ),
    ]


def _check_masses(tour: Tour) -> list[Check]:
    rules = tour.rules
    masses = [rules.m0_kg]
    gap = 0.0
    rocket = 0.0
    unlike = 0.0
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
        unlike = max(unlike, abs(leg.dropped_kg - _drop_kg(leg, rules)))
        masses.append(leg.m_final_kg - leg.dropped_kg)
    return [
        Check(
            "masses left behind",
            unlike <= _MASS_TOLERANCE_KG,
            f"largest difference {unlike:.2e} kg",
            f"{_MASS_TOLERANCE_KG} kg",
        ),
        Check(
            "mass continuous along the tour",
            gap <= _MASS_TOLERANCE_KG,
            f"largest jump {gap:.2e} kg",
            f"{_MASS_TOLERANCE_KG} kg",
        ),
        Check(
            "rocket equation at each impulse",
            rocket <= _MASS_TOLERANCE_KG,
            f"largest error {rocket:.2e} kg",
            f"{_MASS_TOLERANCE_KG} kg",
        ),
        Check(
            "final mass",
            min(masses) >= rules.m_dry_kg - _MASS_TOLERANCE_KG,
            f"{min(masses):.3f} kg",
            f"at least {rules.m_dry_kg:.3f} kg",
        ),
    ]


def _drop_kg(leg: TourLeg, rules: TourRules) -> float:
    """Return what the rules want to be left at the end of a leg."""
    if rules.gtoc5 is None:
        return 0.0
    return rules.gtoc5.penetrator_kg if leg.is_fly_by else rules.gtoc5.package_kg


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
            misplaced <= _TIME_TOLERANCE_DAYS,
            f"largest offset {misplaced:.2e} days",
            f"{_TIME_TOLERANCE_DAYS:g} days",
        ),
    ]


def _check_arrivals(tour: Tour) -> list[Check]:
    misses_km, errors_m_s, slowest = [0.0], [0.0], np.inf
    least = 0.0 if tour.rules.gtoc5 is None else tour.rules.gtoc5.fly_by_speed_min_m_s
    bodies = {body.id: body for body in tour.bodies}
    for leg in tour.legs:
        if leg.from_id not in bodies or leg.to_id not in bodies:
            continue  # Found by the check of the order.
        reached = _fly(leg, bodies[leg.from_id], tour.rules)
        target = body_state(bodies[leg.to_id], leg.t_arr_mjd2000, tour.rules.mu_m3_s2)
        if leg.is_fly_by:
            slowest = min(slowest, float(np.linalg.norm(reached[3:] - target[3:])))
        target[3:] += leg.arr_velocity_m_s
        misses_km.append(float(np.linalg.norm(reached[:3] - target[:3])) / 1e3)
        errors_m_s.append(float(np.linalg.norm(reached[3:] - target[3:])))
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
        Check(
            "speed of fly-bys",
            slowest >= least,
            f"slowest {slowest:.3f} m/s",
            f"at least {least:g} m/s",
        ),
    ]


def _check_elements(tour: Tour, catalogue: Catalogue) -> Check:
    worst = 0.0
    planet = earth()
    for body in tour.bodies:
        # No table has the Earth; problems that start there have its elements in the statement.
        is_earth = tour.rules.gtoc5 is not None and body.id == planet.ids[0]
        table = planet if is_earth else catalogue
        row = int(table.rows_of(np.asarray([body.id]))[0])
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


def body_state(body: TourBody, t_mjd2000: float, mu: float) -> NDArray[np.float64]:
    """Return the (6,) state of a body in m and m/s, by Kepler's equation.

    Position and velocity in the perifocal frame (Vallado, "Fundamentals of
    Astrodynamics and Applications", algorithm 10) are turned by argument of
    perihelion, inclination and node.
    """
    mean_motion = np.sqrt(mu / body.a_m**3)
    anomaly = body.mean_anomaly_rad + mean_motion * (t_mjd2000 - body.epoch_mjd2000) * DAY_S
    anomaly = np.remainder(anomaly, 2 * np.pi)
    eccentric = newton(
        lambda x: x - body.e * np.sin(x) - anomaly,
        x0=anomaly if body.e < 0.8 else np.pi,
        fprime=lambda x: 1 - body.e * np.cos(x),
        tol=1e-15,
        maxiter=200,
    )
    minor = np.sqrt(1 - body.e**2)
    radius = body.a_m * (1 - body.e * np.cos(eccentric))
    position = body.a_m * np.array([np.cos(eccentric) - body.e, minor * np.sin(eccentric), 0.0])
    velocity = (mean_motion * body.a_m**2 / radius) * np.array(
        [-np.sin(eccentric), minor * np.cos(eccentric), 0.0]
    )
    # Intrinsic rotations about z, x, z take the ecliptic frame to the perifocal one.
    frame = Rotation.from_euler("ZXZ", [body.node_rad, body.i_rad, body.argp_rad])
    return np.concatenate([frame.apply(position), frame.apply(velocity)])


def _fly(leg: TourLeg, departure: TourBody, rules: TourRules) -> NDArray[np.float64]:
    """Integrate a leg from its departure body through all impulses to its arrival epoch."""
    state = body_state(departure, leg.t_dep_mjd2000, rules.mu_m3_s2)
    state[3:] += leg.dep_velocity_m_s
    t = leg.t_dep_mjd2000
    for impulse in leg.impulses:
        state = _coast(state, (impulse.t_mjd2000 - t) * DAY_S, rules.mu_m3_s2)
        state[3:] += impulse.dv_m_s
        t = impulse.t_mjd2000
    return _coast(state, (leg.t_arr_mjd2000 - t) * DAY_S, rules.mu_m3_s2)


def _coast(state: NDArray[np.float64], dt_s: float, mu: float) -> NDArray[np.float64]:
    """Integrate two-body motion with DOP853, in units of AU and the matching velocity."""
    speed = np.sqrt(mu / AU)
    scale = np.array([AU, AU, AU, speed, speed, speed])

    def motion(_t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        r = y[:3]
        return np.concatenate([y[3:], -r / np.linalg.norm(r) ** 3])

    solution = solve_ivp(
        motion, (0.0, dt_s * speed / AU), state / scale, method="DOP853", rtol=1e-12, atol=1e-13
    )
    end: NDArray[np.float64] = solution.y[:, -1] * scale
    return end
