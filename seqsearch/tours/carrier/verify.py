"""Independent verification of a carrier with craft, from its files alone.

Nothing here is shared with what found, refined or wrote the flight, neither code nor imports:
coasts and thrust arcs are integrated anew with scipy's DOP853, bodies are propagated by solving
Kepler's equation with scipy, and every rule is checked from the numbers in the files.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S
from seqsearch.tours.carrier.reading import CAPTURE, IMPULSE, LAUNCH, RELEASE, CarrierFiles, LogRow
from seqsearch.tours.carrier.records import CarrierRules
from seqsearch.tours.carrier.verify_craft import (
    ROW_TOLERANCE_KM,
    ROW_TOLERANCE_M_S,
    CraftFlight,
    craft_checks,
    near,
)
from seqsearch.tours.checks import (
    MASS_TOLERANCE_KG,
    SPEED_TOLERANCE_M_S,
    TIME_TOLERANCE_DAYS,
    Check,
    Verification,
    largest,
)
from seqsearch.tours.motion import body_state, coast
from seqsearch.tours.records import TourBody

_Array = NDArray[np.float64]

_LAUNCH_TOLERANCE_M_S: Final = SPEED_TOLERANCE_M_S
"""By how much the speed at launch may exceed the limit: the rounding of numbers in files."""


def verify_carrier(
    files: CarrierFiles, bodies: Mapping[str, TourBody], rules: CarrierRules
) -> Verification:
    """Check a carrier and its craft against the rules of a problem and the laws of motion.

    Parameters
    ----------
    files : CarrierFiles
        As they were read.
    bodies : mapping of str to TourBody
        The bodies by the names that the phases give them.
    rules : CarrierRules
        What the flight has to respect.

    Returns
    -------
    Verification
        All checks; the last one says what counts.

    Raises
    ------
    InputError
        A phase names a body that is not among them.
    """
    log = files.log
    coasted = [_coasted(before, after, rules) for before, after in pairwise(log)]
    checks = [*_check_order(files, rules), *_check_launch(log[0], rules)]
    checks += [*_check_coasts(log, coasted), *_check_masses(files, coasted, rules)]
    craft: list[CraftFlight] = []
    for number, phases in files.craft.items():
        craft.append(
            CraftFlight.of(
                number,
                phases,
                _row(log, RELEASE, number),
                _row(log, CAPTURE, number),
                bodies,
                rules,
            )
        )
        checks += craft_checks(craft[-1], rules)
    checks += _check_visits(craft, log, rules)
    return Verification(tuple(checks))


def _row(log: tuple[LogRow, ...], kind: str, craft: int) -> LogRow | None:
    return next((row for row in log if row.kind == kind and row.craft == craft), None)


def _coasted(before: LogRow, after: LogRow, rules: CarrierRules) -> _Array:
    """Return the (6,) state just before an event, flown from the event before it."""
    dt_s = (after.t_mjd2000 - before.t_mjd2000) * DAY_S
    return coast(before.state, dt_s, rules.mu_m3_s2) if dt_s else before.state


def _check_order(files: CarrierFiles, rules: CarrierRules) -> list[Check]:
    log = files.log
    wrong = []
    if [row.kind == LAUNCH for row in log] != [True, *[False] * (len(log) - 1)]:
        wrong.append("not one launch, first")
    out: set[int] = set()
    back: set[int] = set()
    for row in log:
        if row.kind == RELEASE:
            if row.craft in out or row.craft > rules.craft_count:
                wrong.append(f"{row}, which is not aboard")
            out.add(row.craft)
        elif row.kind == CAPTURE:
            if row.craft not in out - back:
                wrong.append(f"{row}, which is not out")
            back.add(row.craft)
    wrong += [f"P{craft} is never released" for craft in sorted(files.craft.keys() - out)]
    impulses = sum(row.kind == IMPULSE for row in log)
    captures = [row.t_mjd2000 for row in log if row.kind == CAPTURE]
    days = (captures[-1] if captures else log[-1].t_mjd2000) - log[0].t_mjd2000
    return [
        Check("order of events", not wrong, ", ".join(wrong) or f"{len(log)} events", "in order"),
        Check(
            "impulses",
            impulses <= rules.max_impulses,
            str(impulses),
            f"at most {rules.max_impulses}",
        ),
        Check(
            "duration, launch to last capture",
            days <= rules.max_duration_days + TIME_TOLERANCE_DAYS,
            f"{days:.3f} days",
            f"{rules.max_duration_days:.3f} days",
        ),
    ]


def _check_launch(launch: LogRow, rules: CarrierRules) -> list[Check]:
    earliest, latest = rules.launch_mjd2000
    outside = largest([earliest - launch.t_mjd2000, launch.t_mjd2000 - latest])
    relative = launch.state - body_state(rules.planet, launch.t_mjd2000, rules.mu_m3_s2)
    v_inf = float(np.linalg.norm(relative[3:]))
    away_km = float(np.linalg.norm(relative[:3])) / 1e3
    return [
        Check(
            "launch in the window",
            outside <= TIME_TOLERANCE_DAYS,
            f"{launch.t_mjd2000:.3f} MJD2000",
            f"{earliest:.3f} to {latest:.3f}",
        ),
        near("position at launch", away_km, rules.position_km, "km"),
        Check(
            "speed at launch",
            v_inf <= rules.v_inf_max_m_s + _LAUNCH_TOLERANCE_M_S,
            f"{v_inf:.6f} m/s",
            f"{rules.v_inf_max_m_s:g} m/s",
        ),
        Check(
            "mass at launch",
            abs(launch.mass_kg - rules.m0_kg) <= MASS_TOLERANCE_KG,
            f"{launch.mass_kg:.6f} kg",
            f"{rules.m0_kg:g} kg",
        ),
    ]


def _check_coasts(log: tuple[LogRow, ...], coasted: list[_Array]) -> list[Check]:
    """Check the motion between events; impulses change the velocity, and nothing else does."""
    jumps = [row.state - state for row, state in zip(log[1:], coasted, strict=True)]
    away_km = largest(float(np.linalg.norm(jump[:3])) / 1e3 for jump in jumps)
    astray_m_s = largest(
        float(np.linalg.norm(jump[3:]))
        for row, jump in zip(log[1:], jumps, strict=True)
        if row.kind != IMPULSE
    )
    return [
        near("carrier: coasts, position", away_km, ROW_TOLERANCE_KM, "km"),
        near("carrier: coasts, velocity", astray_m_s, ROW_TOLERANCE_M_S, "m/s"),
    ]


def _check_masses(files: CarrierFiles, coasted: list[_Array], rules: CarrierRules) -> list[Check]:
    log = files.log
    exhaust = rules.isp_s * rules.g0_m_s2
    burnt, released, caught = [], [], []
    alone = log[0].mass_kg - rules.craft_count * rules.craft.m0_kg
    for before, row, state in zip(log, log[1:], coasted, strict=False):
        change = row.mass_kg - before.mass_kg
        if row.kind == IMPULSE:
            dv = float(np.linalg.norm(row.state[3:] - state[3:]))
            burnt.append(abs(change - before.mass_kg * np.expm1(-dv / exhaust)))
            alone += change
        elif row.kind == RELEASE:
            released.append(abs(change + rules.craft.m0_kg))
        elif row.kind == CAPTURE:
            phases = files.craft[row.craft]
            caught.append(abs(change - float(phases[-1].mass_kg[-1])))
    return [
        _mass("carrier: rocket equation", burnt),
        _mass("carrier: mass lost at releases", released),
        _mass("carrier: mass gained at captures", caught),
        Check(
            "carrier: final mass without craft",
            alone >= rules.m_dry_kg - MASS_TOLERANCE_KG,
            f"{alone:.3f} kg",
            f"at least {rules.m_dry_kg:.3f} kg",
        ),
    ]


def _mass(name: str, errors: list[float]) -> Check:
    worst = largest(errors)
    found = f"largest error {worst:.2e} kg"
    return Check(name, worst <= MASS_TOLERANCE_KG, found, f"{MASS_TOLERANCE_KG:g} kg")


def _check_visits(
    craft: list[CraftFlight], log: tuple[LogRow, ...], rules: CarrierRules
) -> list[Check]:
    visits = [body.id for flight in craft for body in flight.stops]
    repeated = sorted({body for body in visits if visits.count(body) > 1})
    counted = {body.id for flight in craft if flight.came_back for body in flight.stops}
    released = {row.craft for row in log if row.kind == RELEASE}
    kept_kg = rules.craft.m0_kg * (rules.craft_count - len(released))
    kept_kg += sum(flight.final_kg for flight in craft if flight.came_back)
    return [
        Check("no body twice", not repeated, str(repeated) if repeated else "none", "none"),
        Check(
            "score",
            bool(np.isfinite(kept_kg)),
            f"{len(counted)} asteroids, craft {kept_kg:.3f} kg together",
            "any",
        ),
    ]
