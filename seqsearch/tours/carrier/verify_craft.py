"""Independent verification of a craft: from its release by the carrier to its capture."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S
from feasibility.errors import InputError
from seqsearch.tours.carrier.reading import LogRow
from seqsearch.tours.carrier.records import CarrierRules
from seqsearch.tours.checks import (
    MASS_TOLERANCE_KG,
    TIME_TOLERANCE_DAYS,
    Check,
    largest,
    smallest,
)
from seqsearch.tours.motion import body_state
from seqsearch.tours.records import TourBody
from seqsearch.tours.row_motion import RowMotion, fly_rows
from seqsearch.tours.trajectory import Phase

_Array = NDArray[np.float64]

CARRIER: Final = "MOTHER"
"""What the phases call the carrier."""

ROW_TOLERANCE_KM: Final = 1.0
ROW_TOLERANCE_M_S: Final = 1e-3
"""By how much the motion from a row may miss the next one."""

_STEP_DAYS: Final = 1.0

_THRUST_TOLERANCE: Final = 1e-9
"""By how much of the full thrust a row may exceed it: the rounding of numbers in files."""


@final
@dataclass(frozen=True, eq=False)
class CraftFlight:
    """A craft's phases, with where the carrier and the bodies are at their ends.

    Attributes
    ----------
    number : int
        Of the craft, from 1.
    phases : tuple of Phase
        In order of time.
    motions : tuple of RowMotion
        What the integration of each phase found.
    release, capture : LogRow or None
        The events in the carrier's file.
    stops : tuple of TourBody
        The bodies at which it stays, in order.
    stays_days : tuple of float
        How long.
    places : tuple of (6,) arrays
        Where it has to be at the departure and the arrival of each phase, m and m/s; NaN for a
        carrier that has no such event.
    carrier_away : tuple of (6,) arrays
        States of the carrier relative to bodies at which it releases or catches the craft.
    """

    number: int
    phases: tuple[Phase, ...]
    motions: tuple[RowMotion, ...]
    release: LogRow | None
    capture: LogRow | None
    stops: tuple[TourBody, ...]
    stays_days: tuple[float, ...]
    places: tuple[_Array, ...]
    carrier_away: tuple[_Array, ...]

    @classmethod
    def of(
        cls,
        number: int,
        phases: tuple[Phase, ...],
        release: LogRow | None,
        capture: LogRow | None,
        bodies: Mapping[str, TourBody],
        rules: CarrierRules,
    ) -> "CraftFlight":
        """Fly a craft's phases.

        Raises
        ------
        InputError
            A phase names a body that is not among `bodies`, or the carrier on the way.
        """
        mu = rules.mu_m3_s2
        stops, stays = _stays(number, phases, release, capture, bodies)
        places = []
        for phase in phases:
            for name, row, event in ((phase.start, 0, release), (phase.end, -1, capture)):
                if name == CARRIER:
                    places.append(np.full(6, np.nan) if event is None else event.state)
                else:
                    places.append(body_state(bodies[name], float(phase.t_mjd2000[row]), mu))
        away = [
            event.state - body_state(bodies[name], event.t_mjd2000, mu)
            for name, event in ((phases[0].start, release), (phases[-1].end, capture))
            if name != CARRIER and event is not None
        ]
        isp = rules.craft.isp_s
        motions = tuple(fly_rows(phase, isp, rules.g0_m_s2, mu) for phase in phases)
        return cls(
            number, phases, motions, release, capture, stops, stays, tuple(places), tuple(away)
        )

    @property
    def came_back(self) -> bool:
        """Whether the carrier catches it."""
        return self.capture is not None

    @property
    def final_kg(self) -> float:
        """Mass in the last row."""
        return float(self.phases[-1].mass_kg[-1])


def _stays(
    number: int,
    phases: tuple[Phase, ...],
    release: LogRow | None,
    capture: LogRow | None,
    bodies: Mapping[str, TourBody],
) -> tuple[tuple[TourBody, ...], tuple[float, ...]]:
    """Return where the craft stays, and how long."""
    first, last = phases[0], phases[-1]
    inner = [phase.end for phase in phases[:-1]] + [phase.start for phase in phases[1:]]
    for name in (*inner, first.start, last.end):
        if name not in bodies and (name != CARRIER or name in inner):
            raise InputError(
                f"P{number}: a phase begins or ends at {name!r}, expected an id of the table, or "
                f"{CARRIER} at the beginning of the first and at the end of the last phase"
            )
    names, days = [], []
    if first.start != CARRIER:
        names.append(first.start)
        days.append(np.nan if release is None else first.t_mjd2000[0] - release.t_mjd2000)
    for before, after in pairwise(phases):
        names.append(before.end)
        days.append(after.t_mjd2000[0] - before.t_mjd2000[-1])
    if last.end != CARRIER:
        names.append(last.end)
        # Nothing says how long a craft that nobody catches stays at its last body.
        days.append(np.inf if capture is None else capture.t_mjd2000 - last.t_mjd2000[-1])
    return tuple(bodies[name] for name in names), tuple(map(float, days))


def near(name: str, found: float, limit: float, unit: str) -> Check:
    """Return the check that something is near enough."""
    return Check(name, found <= limit, f"largest error {found:.3e} {unit}", f"{limit:g} {unit}")


def craft_checks(flight: CraftFlight, rules: CarrierRules) -> list[Check]:
    """Return all checks of a craft, each with the craft's number in its name."""
    checks = [*_check_times(flight, rules), *_check_ends(flight, rules)]
    checks += [*_check_rows(flight, rules), *_check_masses(flight, rules)]
    label = f"P{flight.number}: "
    return [Check(label + c.name, c.passed, c.found, c.limit) for c in checks]


def _check_times(flight: CraftFlight, rules: CarrierRules) -> list[Check]:
    phases, release, capture = flight.phases, flight.release, flight.capture
    broken = [
        f"{before.end} then {after.start}"
        for before, after in pairwise(phases)
        if before.end != after.start
    ]
    back = [k for k, (a, b) in enumerate(pairwise(phases), 1) if b.t_mjd2000[0] < a.t_mjd2000[-1]]
    broken += [f"phase {k + 1} begins before phase {k} ends" for k in back]
    begin = np.nan if release is None else release.t_mjd2000
    end = float(phases[-1].t_mjd2000[-1]) if capture is None else capture.t_mjd2000
    before = begin - float(phases[0].t_mjd2000[0])
    after = float(phases[-1].t_mjd2000[-1]) - end
    # At the carrier it neither waits nor thrusts: rows begin and end with the events.
    late = largest(
        [
            abs(before) if phases[0].start == CARRIER else max(before, 0.0),
            abs(after) if phases[-1].end == CARRIER else max(after, 0.0),
        ]
    )
    stay = smallest(flight.stays_days)
    limit = rules.craft.max_duration_days
    return [
        Check("phases join", not broken, ", ".join(broken) or "joined", "joined"),
        Check(
            "rows from release to capture",
            late <= TIME_TOLERANCE_DAYS,
            f"off by {late:.2e} days",
            f"{TIME_TOLERANCE_DAYS:g} days",
        ),
        Check(
            "duration, release to capture",
            end - begin <= limit + TIME_TOLERANCE_DAYS,
            f"{end - begin:.3f} days",
            f"{limit:.3f} days",
        ),
        Check(
            "stays",
            stay >= rules.craft.min_stay_days - TIME_TOLERANCE_DAYS,
            f"shortest {stay:.6f} days",
            f"at least {rules.craft.min_stay_days:.3f} days",
        ),
    ]


def _check_ends(flight: CraftFlight, rules: CarrierRules) -> list[Check]:
    """Check departures and arrivals, at bodies and at the carrier."""
    body: list[_Array] = list(flight.carrier_away)
    released: list[_Array] = []
    caught: list[_Array] = []
    starts, ends = flight.places[::2], flight.places[1::2]
    for phase, motion, start, end in zip(flight.phases, flight.motions, starts, ends, strict=True):
        (released if phase.start == CARRIER else body).append(phase.states[0] - start)
        # The last row is what is handed in; the motion through all rows is what is flown.
        misses = [phase.states[-1] - end, motion.end - end]
        (caught if phase.end == CARRIER else body).extend(misses)
    checks = []
    for name, relative in (("release", released), ("bodies", body), ("capture", caught)):
        away_km = largest(float(np.linalg.norm(x[:3])) / 1e3 for x in relative)
        astray = largest(float(np.linalg.norm(x[3:])) for x in relative)
        checks.append(near(f"position at {name}", away_km, rules.position_km, "km"))
        checks.append(near(f"velocity at {name}", astray, rules.velocity_m_s, "m/s"))
    return checks


def _check_rows(flight: CraftFlight, rules: CarrierRules) -> list[Check]:
    rows = sum(map(len, flight.phases))
    jump_km = largest(largest(motion.jump_km) for motion in flight.motions)
    jump_m_s = largest(largest(motion.jump_m_s) for motion in flight.motions)
    thrust = largest(largest(np.linalg.norm(p.thrust_n, axis=1)) for p in flight.phases)
    step = largest(largest(np.diff(phase.t_mjd2000)) for phase in flight.phases)
    return [
        Check(
            "step from each row to the next",
            step <= _STEP_DAYS + TIME_TOLERANCE_DAYS,
            f"largest {step:.6f} days",
            f"{_STEP_DAYS:g} day",
        ),
        Check(
            "motion from each row to the next",
            jump_km <= ROW_TOLERANCE_KM and jump_m_s <= ROW_TOLERANCE_M_S,
            f"{rows} rows, largest jump {1e3 * jump_km:.2e} m and {jump_m_s:.2e} m/s",
            f"{ROW_TOLERANCE_KM:g} km, {ROW_TOLERANCE_M_S:g} m/s",
        ),
        Check(
            "thrust",
            thrust <= rules.craft.thrust_n * (1.0 + _THRUST_TOLERANCE),
            f"largest {thrust:.12g} N",
            f"{rules.craft.thrust_n:g} N",
        ),
    ]


def _check_masses(flight: CraftFlight, rules: CarrierRules) -> list[Check]:
    exhaust = rules.craft.isp_s * rules.g0_m_s2
    errors = []
    for phase in flight.phases:
        flow = np.linalg.norm(phase.thrust_n[:-1], axis=1) / exhaust
        lost = flow * np.diff(phase.t_mjd2000) * DAY_S
        errors.append(float(np.abs(np.diff(phase.mass_kg) + lost).sum()))
    flow_kg = largest(errors)
    first = float(flight.phases[0].mass_kg[0])
    steps = largest(
        abs(float(after.mass_kg[0] - before.mass_kg[-1]))
        for before, after in pairwise(flight.phases)
    )
    least = smallest(float(phase.mass_kg.min()) for phase in flight.phases)
    return [
        Check(
            "mass at release",
            abs(first - rules.craft.m0_kg) <= MASS_TOLERANCE_KG,
            f"{first:.6f} kg",
            f"{rules.craft.m0_kg:g} kg",
        ),
        Check(
            "mass flow is thrust over exhaust velocity",
            flow_kg <= MASS_TOLERANCE_KG,
            f"largest error in a phase {flow_kg:.2e} kg",
            f"{MASS_TOLERANCE_KG:g} kg",
        ),
        Check(
            "mass during stays",
            steps <= MASS_TOLERANCE_KG,
            f"largest change {steps:.2e} kg",
            f"{MASS_TOLERANCE_KG:g} kg",
        ),
        Check(
            "final mass",
            least >= rules.craft.m_dry_kg - MASS_TOLERANCE_KG,
            f"{least:.3f} kg",
            f"at least {rules.craft.m_dry_kg:.3f} kg",
        ),
    ]
