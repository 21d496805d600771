"""`Tour`: a sequence of visits, ready to be written, read and verified."""

from typing import Any, Final, final

from msgspec import UNSET, UnsetType

from feasibility.constants import G0, MU_SUN
from feasibility.errors import InputError
from seqsearch.tours.display import dataframe, html_table, text_table
from seqsearch.tours.events.protocol import TourEvent
from seqsearch.tours.records import KernelFile, Record, TourBody, TourLeg
from seqsearch.tours.scores.protocol import ScoreRule
from seqsearch.tours.scores.visits import VisitCount

FORMAT: Final = "seqsearch-tour-2"
"""Name and version of the layout of ``sequence.json``."""


@final
class TourRules(Record, frozen=True, kw_only=True):
    """What the tour has to respect: the problem in numbers.

    Attributes
    ----------
    events : tuple of TourEvent
        What is allowed beyond legs from rest to rest; nothing where it is empty.
    start_counts : bool
        Whether the body at which the tour starts counts as visited.
    score : ScoreRule
        What counts.
    kernels : tuple of KernelFile, optional
        SPK kernels that say how the bodies move, whose ids are then NAIF's. The file says nothing
        where they move on Kepler orbits.
    end_id : int, optional
        Id of the body at which the tour ends; the file says nothing where that is free. It may
        be the start, and its arrival is followed by no stay.
    must_visit : tuple of int, optional
        Ids of bodies that the tour has to visit.
    unscored : tuple of TourBody, optional
        Bodies that do not count, at which the tour may start or end: with their elements, as no
        asteroid table has them.
    """

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
    events: tuple[TourEvent, ...] = ()
    start_counts: bool = True
    score: ScoreRule = VisitCount()
    mu_m3_s2: float = MU_SUN
    g0_m_s2: float = G0
    kernels: tuple[KernelFile, ...] | UnsetType = UNSET
    end_id: int | UnsetType = UNSET
    must_visit: tuple[int, ...] | UnsetType = UNSET
    unscored: tuple[TourBody, ...] | UnsetType = UNSET

    def visits(self, bodies: tuple[TourBody, ...]) -> tuple[TourBody, ...]:
        """Return those bodies of a tour that count; the start body, if it ends there too, once."""
        visited = bodies if self.start_counts else bodies[1:]
        apart = {body.id for body in self.unscored or ()}
        if self.end_id is not UNSET and len(bodies) > 1 and bodies[-1].id == bodies[0].id:
            visited = visited[:-1]
        return tuple(body for body in visited if body.id not in apart) if apart else visited


@final
class Tour(Record, frozen=True, kw_only=True):
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
    score : float
        What the problem counts, by ``rules.score``.
    """

    format: str = FORMAT
    rules: TourRules
    t_start_mjd2000: float
    bodies: tuple[TourBody, ...]
    legs: tuple[TourLeg, ...]
    score: float

    @property
    def n_asteroids(self) -> int:
        """Number of visited bodies that count."""
        return len(self.visits)

    @property
    def visits(self) -> tuple[TourBody, ...]:
        """The visited bodies in order, without those that do not count, like a launch planet."""
        return self.rules.visits(self.bodies)

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

    def one_line(self) -> str:
        """Return the ids in order of visit, joined by arrows."""
        return " -> ".join(str(body.id) for body in self.bodies)

    def table(self) -> str:
        """Return the legs as a text table."""
        return text_table(self)

    def to_dataframe(self) -> Any:
        """Return the legs as a `pandas.DataFrame`, one row a leg.

        Raises
        ------
        MissingDependencyError
            pandas is not installed.
        """
        return dataframe(self)

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
        rule = self.rules.score
        if not rule.name:
            return visits
        return f"{rule.name} {self.score:.1f} {rule.unit}".rstrip() + f", {visits}"

    def __repr__(self) -> str:
        return f"Tour({self.rules.name}: {self.summary()})"

    def _repr_html_(self) -> str:
        return html_table(self)
