"""Independent verification of the rows of a flight with continuous thrust.

Nothing here is shared with what refined the tour, neither code nor imports: rows are integrated
anew with scipy's DOP853, bodies are propagated by solving Kepler's equation with scipy, and every
rule of the problem is checked from the numbers in the exported file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S
from feasibility.errors import InputError
from seqsearch.tours.bodies.kernel_states import BodyState, states_by_rules
from seqsearch.tours.checks import (
    MASS_TOLERANCE_KG,
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
from seqsearch.tours.events.drop import Drop
from seqsearch.tours.events.fly_by import FlyBy
from seqsearch.tours.events.launch import Launch
from seqsearch.tours.events.make import event_kinds
from seqsearch.tours.records import TourBody, TourLeg, Vector
from seqsearch.tours.row_motion import RowMotion, fly_rows
from seqsearch.tours.tour import TourRules
from seqsearch.tours.trajectory import Phase, Trajectory

_ROW_TOLERANCE_KM: Final = 1.0
_ROW_TOLERANCE_M_S: Final = 1e-3
"""By how much the motion from a row may miss the next one."""

_THRUST_TOLERANCE: Final = 1e-9
"""By how much of the full thrust a row may exceed it: the rounding of numbers in files."""

_RESTING_M_S: Final = 1.0
"""Speed up to which an arrival is taken for one at rest, where visits may be fly-bys."""

_AT_REST: Final = 0.5
"""Share of the least speed of fly-bys below which an arrival is taken for a rendezvous."""


@final
@dataclass(frozen=True)
class Tolerances:
    """How exactly bodies have to be met.

    Attributes
    ----------
    position_km, velocity_m_s : float
        Distance and relative velocity, as the GTOC problem statements have them.
    """

    position_km: float = 1000.0
    velocity_m_s: float = 1.0


@final
@dataclass(frozen=True, eq=False)
class _Flown:
    """A phase with its bodies and what the integration found."""

    phase: Phase
    start: TourBody
    end: TourBody
    motion: RowMotion
    departure: NDArray[np.float64]
    arrival: NDArray[np.float64]
    mu: float

    @property
    def left_behind(self) -> NDArray[np.float64]:
        """State of the first row relative to the body of the departure."""
        relative: NDArray[np.float64] = self.phase.states[0] - self.departure
        return relative

    def misses(self) -> list[NDArray[np.float64]]:
        """Return the states at the arrival relative to the body: of the last row, and as flown."""
        return [self.phase.states[-1] - self.arrival, self.motion.end - self.arrival]


def verify_rows(
    trajectory: Trajectory,
    bodies: Mapping[str, TourBody],
    rules: TourRules,
    tolerances: Tolerances = Tolerances(),
    kernels: Sequence[Path] = (),
) -> Verification:
    """Check rows against the rules of a problem and the laws of motion.

    Parameters
    ----------
    trajectory : Trajectory
        The rows, as read from the exported file.
    bodies : mapping of str to TourBody
        The bodies by the names that the rows give them.
    rules : TourRules
        What the flight has to respect.
    tolerances : Tolerances
        How exactly bodies have to be met.
    kernels : sequence of Path
        SPK kernels, for rules by which the bodies move as kernels say.

    Returns
    -------
    Verification
        All checks.

    Raises
    ------
    InputError
        A phase names a body that is not among them, or kernels of the rules are missing.
    """
    with states_by_rules(rules, kernels) as where:
        flown = [_flown(phase, bodies, rules, where) for phase in trajectory.phases]
    legs = _legs(flown, rules)
    ends = {f.end.id: f.end for f in flown}
    stops = (
        flown[0].start,
        *(ends[body] for body in visited_ids(legs)),
    )
    arrivals = tuple(Arrival(f.motion.end, f.arrival) for f in flown)
    tour = FlownTour(stops, legs, arrivals)
    checks = [*_check_order(flown, stops, rules), *_check_times(flown, legs, rules)]
    checks += [*_check_rows(flown, rules), *_check_masses(flown, legs, rules)]
    checks += _check_ends(flown, legs, rules, tolerances)
    given = {type(event) for event in rules.events}
    absent = (kind.forbidden() for kind in event_kinds().values() if kind not in given)
    for event in (*rules.events, *absent):
        if event is not None:
            checks += event.checks(tour)
    score = rules.score.score(rules.visits(stops), legs)
    name = rules.score.name or "asteroids"
    checks.append(Check("score", True, f"{name} {score:.6g} {rules.score.unit}".rstrip(), "any"))
    return Verification(tuple(checks))


def _flown(
    phase: Phase, bodies: Mapping[str, TourBody], rules: TourRules, where: BodyState
) -> _Flown:
    for name in (phase.start, phase.end):
        if name not in bodies:
            raise InputError(f"{phase}: no body {name!r}, expected one of the problem's table")
    start, end, mu = bodies[phase.start], bodies[phase.end], rules.mu_m3_s2
    return _Flown(
        phase,
        start,
        end,
        fly_rows(phase, rules.isp_s, rules.g0_m_s2, mu),
        where(start, float(phase.t_mjd2000[0])),
        where(end, float(phase.t_mjd2000[-1])),
        mu,
    )


def _legs(flown: Sequence[_Flown], rules: TourRules) -> tuple[TourLeg, ...]:
    """Return the legs that the rows fly, without impulses, for the checks of events."""
    fly_by = next((event for event in rules.events if isinstance(event, FlyBy)), None)
    launched = any(isinstance(event, Launch) for event in rules.events)
    legs: list[TourLeg] = []
    for k, f in enumerate(flown):
        speed = f.misses()[0][3:]
        passes = _passes(float(np.linalg.norm(speed)), fly_by, last=f is flown[-1])
        free = (k == 0 and launched) or (k > 0 and legs[-1].is_fly_by)
        following = flown[k + 1].phase if k + 1 < len(flown) else None
        legs.append(
            TourLeg(
                from_id=f.start.id,
                to_id=f.end.id,
                t_dep_mjd2000=float(f.phase.t_mjd2000[0]),
                tof_days=float(f.phase.t_mjd2000[-1] - f.phase.t_mjd2000[0]),
                m0_kg=float(f.phase.mass_kg[0]),
                m_final_kg=float(f.phase.mass_kg[-1]),
                m_star_kg=float(f.phase.mass_kg[0]),
                impulses=(),
                dep_velocity_m_s=_vector(f.left_behind[3:]) if free else (0.0, 0.0, 0.0),
                arr_velocity_m_s=_vector(speed) if passes else (0.0, 0.0, 0.0),
                dropped_kg=_dropped(f.phase, following, passes, rules),
            )
        )
    return tuple(legs)


def _passes(speed_m_s: float, rule: FlyBy | None, *, last: bool) -> bool:
    """Tell whether an arrival is a fly-by: fast, where the rules know such."""
    if rule is None:
        return False
    if rule.visit_bound(last=last) > 0.0:
        return speed_m_s > _RESTING_M_S
    return rule.times > 0 and speed_m_s > _AT_REST * rule.speed_min_m_s


def _dropped(phase: Phase, following: Phase | None, passes: bool, rules: TourRules) -> float:
    """Return what is left behind at an arrival; after the last one, what the rules ask."""
    if following is not None:
        return float(phase.mass_kg[-1] - following.mass_kg[0])
    return sum(
        event.fly_by_kg if passes else event.rendezvous_kg
        for event in rules.events
        if isinstance(event, Drop)
    )


def _vector(values: NDArray[np.float64]) -> Vector:
    return (float(values[0]), float(values[1]), float(values[2]))


def _check_order(
    flown: Sequence[_Flown], stops: tuple[TourBody, ...], rules: TourRules
) -> list[Check]:
    broken = [
        f"{before.phase.end} then {after.phase.start}"
        for before, after in pairwise(flown)
        if before.phase.end != after.phase.start
    ]
    ids = [body.id for body in stops]
    repeated = visited_twice(rules, ids)
    allowed = rules.start_ids
    return [
        Check("phases join", not broken, ", ".join(broken) or "joined", "joined"),
        Check("no body twice", not repeated, str(repeated) if repeated else "none", "none"),
        Check(
            "start body allowed",
            not allowed or ids[0] in allowed,
            flown[0].phase.start,
            str(list(allowed)) if allowed else "any",
        ),
        *check_ends(rules, stops),
    ]


def _check_times(
    flown: Sequence[_Flown], legs: Sequence[TourLeg], rules: TourRules
) -> list[Check]:
    earliest, latest = rules.first_departure_mjd2000
    first, last = float(flown[0].phase.t_mjd2000[0]), float(flown[-1].phase.t_mjd2000[-1])
    shortest = smallest(
        after.t_dep_mjd2000 - before.t_arr_mjd2000
        for before, after in pairwise(legs)
        if not before.is_fly_by
    )
    outside = largest([earliest - first, first - latest])
    return [
        Check(
            "first departure in the window",
            outside <= TIME_TOLERANCE_DAYS,
            f"{first:.3f} MJD2000",
            f"{earliest:.3f} to {latest:.3f}",
        ),
        Check(
            "duration",
            last - first <= rules.max_duration_days + TIME_TOLERANCE_DAYS,
            f"{last - first:.3f} days",
            f"{rules.max_duration_days:.3f} days",
        ),
        Check(
            "stays",
            shortest >= rules.min_stay_days - TIME_TOLERANCE_DAYS,
            f"{shortest:.6f} days",
            f"at least {rules.min_stay_days:.3f} days",
        ),
    ]


def _check_rows(flown: Sequence[_Flown], rules: TourRules) -> list[Check]:
    rows = sum(len(f.phase) for f in flown)
    jump_km = largest(largest(f.motion.jump_km) for f in flown)
    jump_m_s = largest(largest(f.motion.jump_m_s) for f in flown)
    thrust = largest(largest(np.linalg.norm(f.phase.thrust_n, axis=1)) for f in flown)
    return [
        Check(
            "motion from each row to the next",
            jump_km <= _ROW_TOLERANCE_KM and jump_m_s <= _ROW_TOLERANCE_M_S,
            f"{rows} rows, largest jump {1e3 * jump_km:.2e} m and {jump_m_s:.2e} m/s",
            f"{_ROW_TOLERANCE_KM:g} km, {_ROW_TOLERANCE_M_S:g} m/s",
        ),
        Check(
            "thrust",
            thrust <= rules.thrust_n * (1.0 + _THRUST_TOLERANCE),
            f"largest {thrust:.12g} N",
            f"{rules.thrust_n:g} N",
        ),
    ]


def _check_masses(
    flown: Sequence[_Flown], legs: Sequence[TourLeg], rules: TourRules
) -> list[Check]:
    exhaust = rules.isp_s * rules.g0_m_s2
    errors = []
    for f in flown:
        burnt = np.linalg.norm(f.phase.thrust_n[:-1], axis=1) / exhaust
        lost = burnt * np.diff(f.phase.t_mjd2000) * DAY_S
        errors.append(float(np.abs(np.diff(f.phase.mass_kg) + lost).sum()))
    flow = largest(errors)
    start = abs(legs[0].m0_kg - rules.m0_kg)
    gained = largest(-leg.dropped_kg for leg in legs)
    dropping = any(isinstance(event, Drop) for event in rules.events)
    lost = 0.0 if dropping else largest(abs(leg.dropped_kg) for leg in legs)
    least = smallest(leg.m_final_kg - leg.dropped_kg for leg in legs)
    return [
        Check(
            "mass at the first departure",
            start <= MASS_TOLERANCE_KG,
            f"{legs[0].m0_kg:.6f} kg",
            f"{rules.m0_kg:g} kg",
        ),
        Check(
            "mass flow is thrust over exhaust velocity",
            flow <= MASS_TOLERANCE_KG,
            f"largest error in a phase {flow:.2e} kg",
            f"{MASS_TOLERANCE_KG:g} kg",
        ),
        Check(
            "mass from phase to phase",
            max(gained, lost) <= MASS_TOLERANCE_KG,
            f"largest change beyond what is left behind {max(gained, lost):.2e} kg",
            f"{MASS_TOLERANCE_KG:g} kg",
        ),
        Check(
            "final mass",
            least >= rules.m_dry_kg - MASS_TOLERANCE_KG,
            f"{least:.3f} kg",
            f"at least {rules.m_dry_kg:.3f} kg",
        ),
    ]


def _check_ends(
    flown: Sequence[_Flown], legs: Sequence[TourLeg], rules: TourRules, tolerances: Tolerances
) -> list[Check]:
    """Check where phases begin and end; at fly-bys the velocity is that of the next phase."""
    launched = any(isinstance(event, Launch) for event in rules.events)
    away_km, astray_m_s, miss_km, error_m_s = [], [], [], []
    for k, (f, leg) in enumerate(zip(flown, legs, strict=True)):
        away_km.append(float(np.linalg.norm(f.left_behind[:3])) / 1e3)
        if k > 0 and legs[k - 1].is_fly_by:
            jump = f.phase.states[0] - flown[k - 1].phase.states[-1]
            astray_m_s.append(float(np.linalg.norm(jump[3:])))
        elif k > 0 or not launched:
            astray_m_s.append(float(np.linalg.norm(f.left_behind[3:])))
        for miss in f.misses():
            miss_km.append(float(np.linalg.norm(miss[:3])) / 1e3)
            if not leg.is_fly_by:
                error_m_s.append(float(np.linalg.norm(miss[3:])))
    return [
        _near("position at each departure", largest(away_km), tolerances.position_km, "km"),
        _near("velocity at each departure", largest(astray_m_s), tolerances.velocity_m_s, "m/s"),
        _near("position at each arrival", largest(miss_km), tolerances.position_km, "km"),
        _near("velocity at each arrival", largest(error_m_s), tolerances.velocity_m_s, "m/s"),
    ]


def _near(name: str, found: float, limit: float, unit: str) -> Check:
    return Check(name, found <= limit, f"largest error {found:.3e} {unit}", f"{limit:g} {unit}")
