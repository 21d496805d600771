"""`Tour`: a sequence of visits, ready to be written, read and verified."""

from pathlib import Path
from typing import Final, Self, final

import msgspec
import numpy as np
from numpy.typing import NDArray

from feasibility import InputError
from feasibility.constants import DAY_S, G0, MJD2000_MJD, MU_SUN
from seqsearch.core.custom_moves import OwnMoves
from seqsearch.core.problem import TourProblem
from seqsearch.core.tree import FlownLeg, SearchTree
from seqsearch.problems.gtoc5.problem import Gtoc5Problem
from seqsearch.problems.gtoc5.rules import Gtoc5Rules

FORMAT: Final = "seqsearch-tour-1"
"""Name and version of the layout of ``sequence.json``."""

_REST_M_S: Final = 1e-6
"""Relative speed below which a spacecraft is at rest at a body."""


class _Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A JSON object in which every key is known."""


@final
class Impulse(_Record, frozen=True, kw_only=True):
    """One impulse of a Sims-Flanagan leg, at the centre of its segment."""

    t_mjd2000: float
    dv_m_s: tuple[float, float, float]
    throttle: tuple[float, float, float]
    mass_before_kg: float
    mass_after_kg: float


@final
class TourLeg(_Record, frozen=True, kw_only=True):
    """One leg: from departure at a body to arrival at the next.

    Attributes
    ----------
    dep_velocity_m_s, arr_velocity_m_s : tuple of float
        Velocities at departure and arrival, relative to the bodies: zero at
        rest, otherwise that of a launch or of a fly-by.
    dropped_kg : float
        What is left behind at the arrival.
    """

    from_id: int
    to_id: int
    t_dep_mjd2000: float
    tof_days: float
    m0_kg: float
    m_final_kg: float
    m_star_kg: float
    impulses: tuple[Impulse, ...]
    dep_velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    arr_velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    dropped_kg: float = 0.0

    @property
    def is_fly_by(self) -> bool:
        """Whether the leg passes its target, rather than ending at rest there."""
        return any(self.arr_velocity_m_s)

    @property
    def t_arr_mjd2000(self) -> float:
        """Arrival epoch."""
        return self.t_dep_mjd2000 + self.tof_days

    @property
    def margin(self) -> float:
        """Maximum over actual initial mass: 1 is the boundary of what can be flown."""
        return self.m_star_kg / self.m0_kg


@final
class TourBody(_Record, frozen=True, kw_only=True):
    """A visited body with its osculating elements as read from the catalogue."""

    id: int
    name: str
    epoch_mjd2000: float
    a_m: float
    e: float
    i_rad: float
    node_rad: float
    argp_rad: float
    mean_anomaly_rad: float


@final
class TourRules(_Record, frozen=True, kw_only=True):
    """What the tour has to respect: the problem in numbers."""

    name: str
    catalogue: str
    m0_kg: float
    m_dry_kg: float
    thrust_n: float
    isp_s: float
    first_departure_mjd2000: tuple[float, float]
    max_duration_days: float
    min_stay_days: float
    start_ids: tuple[int, ...]
    gtoc5: Gtoc5Rules | None = None
    mu_m3_s2: float = MU_SUN
    g0_m_s2: float = G0


@final
class Tour(_Record, frozen=True, kw_only=True):
    """A sequence of visits with everything needed to check and redraw it.

    Attributes
    ----------
    format : str
        `FORMAT`.
    rules : TourRules
        The problem in numbers.
    t_start_mjd2000 : float
        Epoch of the first departure (of the start, if there is no leg).
    bodies : tuple of TourBody
        The bodies in order of rendezvous, the start body first.
    legs : tuple of TourLeg
        One fewer than the bodies, and those that end with a fly-by.
    """

    format: str = FORMAT
    rules: TourRules
    t_start_mjd2000: float
    bodies: tuple[TourBody, ...]
    legs: tuple[TourLeg, ...]

    @property
    def n_asteroids(self) -> int:
        """Number of visited bodies; the start counts unless it is the Earth of GTOC5."""
        return len(self.bodies) - (self.rules.gtoc5 is not None)

    @property
    def score(self) -> float:
        """What the problem counts: visited bodies, or the score of GTOC5."""
        rules = self.rules.gtoc5
        if rules is None:
            return float(self.n_asteroids)
        score = 0.0
        met: set[int] = set()
        passed: set[int] = set()
        for leg in self.legs:
            weight = rules.bonus_factor if leg.to_id in rules.bonus_ids else 1.0
            if not leg.is_fly_by and leg.to_id not in met:
                met.add(leg.to_id)
                score += weight * rules.rendezvous_score
            elif leg.is_fly_by and leg.to_id in met - passed:
                passed.add(leg.to_id)
                score += weight * rules.fly_by_score
        return score

    def body(self, body_id: int) -> TourBody:
        """Return the body with an id.

        Raises
        ------
        InputError
            There is none.
        """
        for body in self.bodies:
            if body.id == body_id:
                return body
        raise InputError(f"tour: a leg names body {body_id}, which is not among the bodies")

    @property
    def duration_days(self) -> float:
        """Time from the first departure to the last arrival."""
        return self.legs[-1].t_arr_mjd2000 - self.legs[0].t_dep_mjd2000 if self.legs else 0.0

    @property
    def m_final_kg(self) -> float:
        """Mass after the last arrival, without what was left there."""
        if not self.legs:
            return self.rules.m0_kg
        return self.legs[-1].m_final_kg - self.legs[-1].dropped_kg

    @classmethod
    def from_tree(cls, problem: TourProblem, tree: SearchTree, node: int) -> Self:
        """Build the tour that leads to a node of the search tree, with what completes it."""
        flown = tree.legs_to(node)
        last = tree.node(node)
        rows = [flown[0].dep_row if flown else int(last["row"])]
        rows += [leg.arr_row for leg in flown if leg.arr_row != leg.dep_row]
        if isinstance(problem, OwnMoves):
            flown += problem.closing(int(last["row"]), last["t_mjd2000"], last["mass"])
        t_start = flown[0].t_dep_mjd2000 if flown else float(last["t_mjd2000"])
        return cls(
            rules=_rules(problem),
            t_start_mjd2000=t_start,
            bodies=tuple(_body(problem, row) for row in rows),
            legs=tuple(_leg(problem, leg) for leg in flown),
        )

    def one_line(self) -> str:
        """Return the ids in order of visit, joined by arrows."""
        return " -> ".join(str(body.id) for body in self.bodies)

    def table(self) -> str:
        """Return the legs as a text table."""
        header = (
            f"{'leg':>3}  {'from':>7}  {'to':>7}  {'name':<18}  {'departure':>12}  "
            f"{'arrival':>12}  {'days':>7}  {'m0 kg':>8}  {'mf kg':>8}  {'margin':>6}"
        )
        lines = [header, "-" * len(header)]
        lines += [
            f"{k:>3}  {leg.from_id:>7}  {leg.to_id:>7}  {self.body(leg.to_id).name[:18]:<18}  "
            f"{leg.t_dep_mjd2000 + MJD2000_MJD:>12.3f}  {leg.t_arr_mjd2000 + MJD2000_MJD:>12.3f}  "
            f"{leg.tof_days:>7.2f}  {leg.m0_kg:>8.2f}  {leg.m_final_kg:>8.2f}  {leg.margin:>6.3f}"
            for k, leg in enumerate(self.legs, 1)
        ]
        return "\n".join(lines)

    def summary(self) -> str:
        """Return one line: what counts, duration, mass."""
        return (
            f"{self.headline()}, {len(self.legs)} legs, "
            f"{self.duration_days:.1f} of {self.rules.max_duration_days:.1f} days, "
            f"final mass {self.m_final_kg:.1f} kg (dry {self.rules.m_dry_kg:.1f} kg)"
        )

    def headline(self) -> str:
        """Return what counts in a few words."""
        visits = f"{self.n_asteroids} asteroids"
        return visits if self.rules.gtoc5 is None else f"score {self.score:.1f}, {visits}"


def read_tour(path: Path) -> Tour:
    """Read a ``sequence.json``.

    Raises
    ------
    InputError
        The file is missing, truncated, not such a file, or of another version.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        tour = msgspec.json.decode(data, type=Tour)
    except msgspec.DecodeError as error:
        raise InputError(f"{path}: not a complete {FORMAT} file ({error})") from None
    if tour.format != FORMAT:
        raise InputError(f"{path}: format {tour.format!r}, expected {FORMAT!r}")
    return tour


def to_json(tour: Tour) -> str:
    """Return the tour as JSON text, indented; `read_tour` reads it back exactly."""
    return msgspec.json.format(msgspec.json.encode(tour), indent=1).decode() + "\n"


def to_csv(tour: Tour) -> str:
    """Return the legs as CSV, epochs in MJD, one row a leg."""
    lines = [
        "leg,from_id,from_name,to_id,to_name,t_dep_mjd,t_arr_mjd,tof_days,stay_before_days,"
        "m0_kg,m_final_kg,m_star_kg,margin,dropped_kg,dep_speed_m_s,arr_speed_m_s"
    ]
    previous: TourLeg | None = None
    for k, leg in enumerate(tour.legs):
        stay = "" if previous is None else f"{leg.t_dep_mjd2000 - previous.t_arr_mjd2000:.6f}"
        names = [
            tour.body(body_id).name.replace(",", " ").replace('"', "'")
            for body_id in (leg.from_id, leg.to_id)
        ]
        lines.append(
            f"{k + 1},{leg.from_id},{names[0]},{leg.to_id},{names[1]},"
            f"{leg.t_dep_mjd2000 + MJD2000_MJD:.6f},{leg.t_arr_mjd2000 + MJD2000_MJD:.6f},"
            f"{leg.tof_days:.6f},{stay},{leg.m0_kg:.6f},{leg.m_final_kg:.6f},"
            f"{leg.m_star_kg:.6f},{leg.margin:.6f},{leg.dropped_kg:.6f},"
            f"{np.linalg.norm(leg.dep_velocity_m_s):.6f},"
            f"{np.linalg.norm(leg.arr_velocity_m_s):.6f}"
        )
        previous = leg
    return "\n".join(lines) + "\n"


def _rules(problem: TourProblem) -> TourRules:
    craft = problem.spacecraft
    return TourRules(
        name=problem.name,
        catalogue=problem.catalogue.source,
        m0_kg=problem.m0,
        m_dry_kg=craft.m_dry,
        thrust_n=craft.thrust,
        isp_s=craft.isp,
        first_departure_mjd2000=problem.first_departure_mjd2000,
        max_duration_days=problem.max_duration_days,
        min_stay_days=problem.min_stay_days,
        start_ids=problem.start_ids,
        gtoc5=problem.rules if isinstance(problem, Gtoc5Problem) else None,
    )


def _body(problem: TourProblem, row: int) -> TourBody:
    catalogue = problem.catalogue
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


def _leg(problem: TourProblem, leg: FlownLeg) -> TourLeg:
    return TourLeg(
        from_id=int(problem.catalogue.ids[leg.dep_row]),
        to_id=int(problem.catalogue.ids[leg.arr_row]),
        t_dep_mjd2000=leg.t_dep_mjd2000,
        tof_days=leg.tof_days,
        m0_kg=leg.m0,
        m_final_kg=leg.m_final,
        m_star_kg=leg.m_star,
        impulses=_impulses(problem, leg),
        dep_velocity_m_s=_relative(problem, leg.dep_row, leg.t_dep_mjd2000, leg.rv_dep),
        arr_velocity_m_s=_relative(problem, leg.arr_row, leg.t_arr_mjd2000, leg.rv_arr),
        dropped_kg=leg.dropped,
    )


def _relative(
    problem: TourProblem, row: int, t_mjd2000: float, rv: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return the velocity relative to a body, in m/s; exactly zero at rest."""
    velocity = rv[3:] - problem.catalogue.states_at([row], t_mjd2000)[0, 3:]
    if np.linalg.norm(velocity) < _REST_M_S:
        return (0.0, 0.0, 0.0)
    return (float(velocity[0]), float(velocity[1]), float(velocity[2]))


def _impulses(problem: TourProblem, leg: FlownLeg) -> tuple[Impulse, ...]:
    """Turn throttles into impulses in pykep's mass convention.

    An impulse is thrust x segment time x throttle / mass, with the mass before
    the impulse in the first half of the leg and the mass after it in the
    second half (pykep's ``leg.sims_flanagan``, cut 0.5). Masses follow the
    rocket equation forward from the initial mass and backward from the final
    mass; the two meet at the match point within the mass mismatch.
    """
    n = len(leg.throttles)
    forward = n // 2
    exhaust = problem.spacecraft.exhaust_velocity
    push = problem.spacecraft.thrust * leg.tof_days / n * DAY_S
    norms = np.linalg.norm(leg.throttles, axis=1)
    before, after = np.empty(n), np.empty(n)
    mass = leg.m0
    for k in range(forward):
        before[k] = mass
        mass *= float(np.exp(-push * norms[k] / mass / exhaust))
        after[k] = mass
    mass = leg.m_final
    for k in range(n - 1, forward - 1, -1):
        after[k] = mass
        mass *= float(np.exp(push * norms[k] / mass / exhaust))
        before[k] = mass
    reference = np.where(np.arange(n) < forward, before, after)
    dv = leg.throttles * (push / reference)[:, None]
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


__all__ = [
    "FORMAT",
    "Impulse",
    "Tour",
    "TourBody",
    "TourLeg",
    "TourRules",
    "read_tour",
    "to_csv",
    "to_json",
]
