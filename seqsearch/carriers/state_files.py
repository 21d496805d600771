"""`CampaignState`: what a campaign has found, and the file from which it goes on."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, final

import msgspec
import numpy as np

from feasibility import InputError
from feasibility.runtime.atomic import write_text
from seqsearch.carriers.course import Course
from seqsearch.carriers.crew import Crew, own_problem
from seqsearch.carriers.plans import Plan
from seqsearch.carriers.routes import Route
from seqsearch.polish.flight import fly
from seqsearch.polish.itinerary import Itinerary
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.tours.carrier.records import CarrierImpulse

_FORMAT: Final = "seqsearch-campaign-3"

_PlanRow = tuple[tuple[int, ...], tuple[int, ...], tuple[tuple[float, float], ...], float]
"""Ids of the orbits' bodies, the probes' ends and windows, value."""


@final
@dataclass
class CampaignState:
    """What has been found, to go on from.

    Attributes
    ----------
    seed : int
        Varies the release windows and the attempts to improve.
    limit_s : float, optional
        Wall-clock time of all sessions; None for no limit.
    catalogue_sha256 : str
        Which asteroid table it is.
    rated, sifted, continued, chained, judged : list of Plan
        The best of each stage that rates, best first.
    looked : list of int
        How many plans were rated in each of these stages.
    varied : int
        Variations of judged plans that were looked at.
    manned : int
        Judged plans for which crews were looked for.
    launch_share : float
        Share of the launch window that is looked at.
    tried : int
        Attempts to improve.
    crews : list of Crew
        The best, of different plans, best first.
    spent_s : float
        Wall-clock time.
    """

    seed: int = 0
    limit_s: float | None = None
    catalogue_sha256: str = ""
    rated: list[Plan] = field(default_factory=list)
    sifted: list[Plan] = field(default_factory=list)
    continued: list[Plan] = field(default_factory=list)
    chained: list[Plan] = field(default_factory=list)
    judged: list[Plan] = field(default_factory=list)
    looked: list[int] = field(default_factory=lambda: [0, 0, 0, 0, 0])
    varied: int = 0
    manned: int = 0
    tried: int = 0
    launch_share: float = 1.0
    crews: list[Crew] = field(default_factory=list)
    spent_s: float = 0.0


class _Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A JSON object in which every key is known."""


@final
class _ProbeRecord(_Record, frozen=True, kw_only=True):
    ids: tuple[int, ...]
    t_dep_mjd2000: tuple[float, ...]
    tof_days: tuple[float, ...]


@final
class _CourseRecord(_Record, frozen=True, kw_only=True):
    impulses: tuple[CarrierImpulse, ...]
    settled: tuple[int, ...]
    starts: tuple[int, ...]
    ends: tuple[int, ...]
    stays: tuple[int | None, ...]
    stay_epochs: tuple[float, ...]
    route: Route | None


@final
class _CrewRecord(_Record, frozen=True, kw_only=True):
    plan: _PlanRow
    probes: tuple[_ProbeRecord, ...]
    course: _CourseRecord | None = None


@final
class _StateRecord(_Record, frozen=True, kw_only=True):
    format: str
    seed: int
    limit_s: float | None
    spent_s: float
    catalogue_sha256: str
    looked: tuple[int, ...]
    varied: int = 0
    manned: int
    launch_share: float
    tried: int
    rated: tuple[_PlanRow, ...]
    sifted: tuple[_PlanRow, ...]
    continued: tuple[_PlanRow, ...]
    chained: tuple[_PlanRow, ...]
    judged: tuple[_PlanRow, ...]
    crews: tuple[_CrewRecord, ...]


def write_state(path: Path, state: CampaignState, problem: RendezvousProblem) -> None:
    """Write the state of a campaign.

    Raises
    ------
    InputError
        It cannot be written.
    """
    ids = problem.catalogue.ids

    def plan_row(plan: Plan) -> _PlanRow:
        orbits = tuple(ids[np.array(plan.orbits)].tolist())
        return orbits, plan.ends, plan.windows_mjd2000, plan.value

    record = _StateRecord(
        format=_FORMAT,
        seed=state.seed,
        limit_s=state.limit_s,
        spent_s=state.spent_s,
        catalogue_sha256=state.catalogue_sha256,
        looked=tuple(state.looked),
        varied=state.varied,
        manned=state.manned,
        launch_share=state.launch_share,
        tried=state.tried,
        rated=tuple(map(plan_row, state.rated)),
        sifted=tuple(map(plan_row, state.sifted)),
        continued=tuple(map(plan_row, state.continued)),
        chained=tuple(map(plan_row, state.chained)),
        judged=tuple(map(plan_row, state.judged)),
        crews=tuple(
            _CrewRecord(
                plan=plan_row(crew.plan),
                probes=tuple(
                    _ProbeRecord(
                        ids=tuple(ids[flight.itinerary.rows].tolist()),
                        t_dep_mjd2000=tuple(flight.itinerary.t_dep_mjd2000.tolist()),
                        tof_days=tuple(flight.itinerary.tof_days.tolist()),
                    )
                    for flight in crew.flights
                ),
                course=None
                if crew.course is None
                else _CourseRecord(
                    impulses=crew.course.impulses,
                    settled=crew.course.settled,
                    starts=crew.course.starts,
                    ends=crew.course.ends,
                    stays=crew.course.stays,
                    stay_epochs=crew.course.stay_epochs,
                    route=crew.course.route,
                ),
            )
            for crew in state.crews
        ),
    )
    write_text(path, msgspec.json.encode(record).decode() + "\n")


def read_state(path: Path, problem: RendezvousProblem) -> CampaignState:
    """Read the state of a campaign; the tours of its crews are flown once more.

    Raises
    ------
    InputError
        The file is missing or damaged, or a body is not in the catalogue.
    """
    try:
        record = msgspec.json.decode(path.read_bytes(), type=_StateRecord)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except msgspec.DecodeError as error:
        raise InputError(f"{path}: not a complete {_FORMAT} file ({error})") from None
    if record.format != _FORMAT:
        raise InputError(f"{path}: format {record.format!r}, expected {_FORMAT!r}")

    def plan_of(row: _PlanRow) -> Plan:
        orbits, ends, windows, value = row
        if not (orbits and len(ends) == len(windows) and set(ends) <= set(range(len(orbits)))):
            raise InputError(f"{path}: a plan whose orbits, ends and windows do not fit")
        rows = problem.catalogue.rows_of(np.array(orbits))
        return Plan(tuple(rows.tolist()), ends, windows, value)

    def crew_of(crew: _CrewRecord) -> Crew:
        flights = []
        plan = plan_of(crew.plan)
        known = Crew(plan, (), _course_of(path, crew, plan))
        for number, probe in enumerate(crew.probes):
            rows = problem.catalogue.rows_of(np.array(probe.ids)).astype(np.intp)
            flight = fly(
                own_problem(problem, known, number),
                Itinerary(rows, np.array(probe.t_dep_mjd2000), np.array(probe.tof_days)),
            )
            if flight is None:
                raise InputError(f"{path}: a leg of a tour has no solution")
            flights.append(flight)
        return replace(known, flights=tuple(flights))

    return CampaignState(
        seed=record.seed,
        limit_s=record.limit_s,
        spent_s=record.spent_s,
        catalogue_sha256=record.catalogue_sha256,
        looked=list(record.looked),
        varied=record.varied,
        manned=record.manned,
        launch_share=record.launch_share,
        tried=record.tried,
        rated=[plan_of(row) for row in record.rated],
        sifted=[plan_of(row) for row in record.sifted],
        continued=[plan_of(row) for row in record.continued],
        chained=[plan_of(row) for row in record.chained],
        judged=[plan_of(row) for row in record.judged],
        crews=[crew_of(crew) for crew in record.crews],
    )


def _course_of(path: Path, crew: _CrewRecord, plan: Plan) -> Course | None:
    course = crew.course
    if course is None:
        return None
    coasts = {*course.starts, *course.ends, *course.settled}
    stays = {number for number in course.stays if number is not None}
    known = min(coasts) >= 0 and max(coasts) <= len(course.impulses)
    known &= len(course.starts) == len(course.ends) == len(crew.probes)
    orbits = len(plan.orbits)
    known &= len(course.settled) + 1 == len(course.stays) == len(course.stay_epochs) == orbits
    if not (known and stays <= set(range(len(crew.probes)))):
        raise InputError(f"{path}: a course that does not fit its probes and impulses")
    return Course(
        impulses=course.impulses,
        settled=course.settled,
        starts=course.starts,
        ends=course.ends,
        stays=course.stays,
        stay_epochs=course.stay_epochs,
        route=course.route,
    )
