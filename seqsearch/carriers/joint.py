"""`joined_crew`: the mother ship's impulses and the probes' tours, polished together.

What is left of her propellant buys velocity for the probes: an impulse before a release spares a
probe of 2000 kg a week and more of thrust for each 100 m/s. `Schedule` says what she may do; a
local optimiser shifts epochs and impulses, with predictions of the first and last legs alone;
then each tour is retimed from its own orbit to its own one, and the two take turns.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from feasibility import Legs
from feasibility.classifier.predictor import LegPredictor
from seqsearch.carriers.crew import TOUCH_DAYS, Crew, own_problem
from seqsearch.carriers.crew_schedule import schedule_of
from seqsearch.carriers.flight import carrier_of
from seqsearch.carriers.plans import Screen
from seqsearch.carriers.schedule import Act, Outing, Schedule, Step
from seqsearch.polish.flight import Flight, fly
from seqsearch.polish.retiming import retime
from seqsearch.problems.rendezvous import RendezvousProblem

_Array = NDArray[np.float64]

LATE_DAYS: Final = 1.0
"""Time after the capture of a probe that stays at the second asteroid during which she stays as
well: with continuous thrust tours may end some hours later."""

LEAD_DAYS: Final = 4.0
"""Least time between an impulse and a release or capture: retiming shifts them a little."""

_SPARES_KG: Final = (0.5, 10.0)
"""Propellant of hers that is left, as probes come back some grams heavier or lighter; the second
where that was too little."""

_TRUST_DAYS: Final = (150.0, 45.0)
"""How far a round may move her epochs, and those of releases and captures."""

_LARGEST_M_S: Final = 700.0
_STEPS: Final = 80
_DIFFERENCE: Final = 1e-4
_ROUNDS: Final = 4
_ITERATIONS: Final = 20
_WORTH_DAYS: Final = 0.5
"""Days that all probes together have to gain for another round."""

_NO_LEG: Final = -1.0
"""Logarithm of the margin of legs of which nothing is known."""


@final
@dataclass(frozen=True, eq=False)
class _End:
    """The first or the last leg of a probe, of which one end is free."""

    probe: int
    step: int
    first: bool
    row: int
    t_mjd2000: float
    m0_kg: float
    log_m_star: float


@final
@dataclass(frozen=True)
class Wishes:
    """What a joint polish is to gain.

    Attributes
    ----------
    weights : tuple of float
        What a day of each probe is worth.
    days_per_kg : float
        What a kilogram of a probe's propellant is worth, in days of its own.
    """

    weights: tuple[float, ...]
    days_per_kg: float = 0.7


def joined_crew(
    screen: Screen, problem: RendezvousProblem, crew: Crew, rng: np.random.Generator
) -> Crew | None:
    """Return a crew with shorter tours, served by a mother ship with more impulses; None for none.

    Parameters
    ----------
    screen : Screen
        The mother ship, and the predictor.
    problem : RendezvousProblem
        One probe.
    crew : Crew
        With several orbits; one on a course goes on from there.
    rng : Generator
        Draws what is asked for: which probe matters most, what propellant is worth, where the
        optimiser begins.
    """
    weights = tuple(float(weight) for weight in 0.2 + rng.exponential(1.0, len(crew.flights)))
    wishes = Wishes(weights, float(rng.uniform(0.1, 1.5)))
    stirred = float(rng.choice([0.3, 1.0, 2.0]))
    return joined(screen, problem, crew, wishes, rng=rng, stirred=stirred)


def joined(
    screen: Screen,
    problem: RendezvousProblem,
    crew: Crew,
    wishes: Wishes,
    *,
    rng: np.random.Generator,
    stirred: float = 0.0,
) -> Crew | None:
    """Return a crew whose tours are shorter by given wishes; None for none.

    Of a crew that its mother ship cannot serve as it is, any that she can.

    Parameters
    ----------
    screen, problem, crew, rng
        As for `joined_crew`.
    wishes : Wishes
        What to gain.
    stirred : float
        How far the optimiser begins from what there is, in its own units.
    """
    if len(crew.plan.orbits) == 1 or screen.catalogue.ephemeris is not None:
        return None
    best, value = crew, _value(crew, wishes)
    if carrier_of(screen, crew) is None:
        value = -np.inf
    for turn in range(_ROUNDS):
        found = _once(screen, problem, best, wishes, rng, stirred if turn == 0 else 0.0)
        if found is None or _value(found, wishes) < value + _WORTH_DAYS:
            break
        best, value = found, _value(found, wishes)
    return None if best is crew or best.visits() < crew.visits() else best


def _value(crew: Crew, wishes: Wishes) -> float:
    """Return the days saved, which are the better the more of them."""
    return -sum(
        weight * flight.itinerary.duration_days
        for weight, flight in zip(wishes.weights, crew.flights, strict=True)
    )


def _once(
    screen: Screen,
    problem: RendezvousProblem,
    crew: Crew,
    wishes: Wishes,
    rng: np.random.Generator,
    stirred: float,
) -> Crew | None:
    schedule = schedule_of(screen, crew)
    if schedule is None:
        return None
    ends = _ends(crew, schedule)
    if not ends:
        return None
    x = schedule.start() + stirred * rng.normal(size=len(schedule.start()))
    for spare_kg in _SPARES_KG:
        program = _Program(schedule, ends, problem, screen.predictor, wishes, spare_kg)
        solved = program.solve(x)
        if solved is None:
            return None
        found = _retimed(screen, problem, crew, schedule, solved)
        if found is not None:
            return found
        x = solved
    return None


def _ends(crew: Crew, schedule: Schedule) -> list[_End]:
    """Return the legs that the schedule may change."""
    ends = []
    for k, step in enumerate(schedule.steps):
        if step.probe < 0 or not step.free or step.stays:
            continue
        flight = crew.flights[step.probe]
        itinerary = flight.itinerary
        first = step.act is Act.RELEASE
        leg = 0 if first else len(itinerary) - 1
        ends.append(
            _End(
                probe=step.probe,
                step=k,
                first=first,
                row=int(itinerary.rows[1 if first else -2]),
                t_mjd2000=float(
                    itinerary.t_arr_mjd2000[0] if first else itinerary.t_dep_mjd2000[-1]
                ),
                m0_kg=float(flight.mass[leg]),
                log_m_star=float(np.log(flight.m_star[leg] / flight.mass[leg])),
            )
        )
    return ends


@final
class _Program:
    """Days gained as a function of a schedule's numbers, and what has to hold."""

    def __init__(
        self,
        schedule: Schedule,
        ends: list[_End],
        problem: RendezvousProblem,
        predictor: LegPredictor,
        wishes: Wishes,
        spare_kg: float,
    ) -> None:
        self._schedule, self._ends = schedule, ends
        self._spare_kg = spare_kg
        self._predictor, self._wishes = predictor, wishes
        self._craft = problem.spacecraft
        self._goals = [problem.catalogue.states_at([end.row], end.t_mjd2000)[0] for end in ends]
        self._offsets = np.zeros(len(ends))
        steps = schedule.steps
        self._gaps = np.array([_gap(a, b) for a, b in pairwise(steps)])
        self._memory: tuple[bytes, _Array] = (b"", np.zeros(0))
        # The predictor's error at the legs as they are is taken off.
        now = self._margins(schedule.fly(schedule.start()[None]))[0][0]
        wanted = np.array([end.log_m_star for end in ends])
        self._offsets = np.where(now > _NO_LEG, wanted - now, 0.0)

    def solve(self, x: _Array) -> _Array | None:
        """Return the best numbers near given ones; None where what has to hold does not."""
        bounds = self._schedule.bounds(*_TRUST_DAYS, _LARGEST_M_S)
        low, high = np.array(bounds).T
        found = minimize(
            lambda x: -self._at(x)[0],
            np.clip(x, low, high),
            jac=lambda x: -self._slopes(x)[:, 0],
            bounds=bounds,
            constraints={
                "type": "ineq",
                "fun": lambda x: self._at(x)[1:],
                "jac": lambda x: self._slopes(x)[:, 1:].T,
            },
            method="SLSQP",
            options={"maxiter": _STEPS, "ftol": 1e-4},
        )
        x = np.asarray(found.x)
        values = self._at(x)
        holds = np.isfinite(values).all() and bool((values[1:] > -1e-3).all())
        return x if holds else None

    def _at(self, x: _Array) -> _Array:
        values: _Array = self._values(x[None])[0]
        return values

    def _slopes(self, x: _Array) -> _Array:
        """Return (k, c) the change of each value with each number."""
        if self._memory[0] != x.tobytes():
            moved = x + _DIFFERENCE * np.eye(len(x))
            values = self._values(np.concatenate([x[None], moved]))
            self._memory = x.tobytes(), (values[1:] - values[0]) / _DIFFERENCE
        return self._memory[1]

    def _values(self, x: _Array) -> _Array:
        """Return (m, c): days gained; then what must not be negative."""
        outing = self._schedule.fly(x)
        margins, masses = self._margins(outing)
        gained = np.zeros(len(x))
        for k, end in enumerate(self._ends):
            sign = 1.0 if end.first else -1.0
            days = sign * (outing.t[:, end.step] - end.t_mjd2000)
            value = days + self._wishes.days_per_kg * masses[:, k]
            gained += self._wishes.weights[end.probe] * value
        gaps = np.diff(outing.t, axis=1) - self._gaps
        return np.column_stack(
            [gained / 10.0, (outing.left_kg - self._spare_kg) / 10.0, gaps / 10.0, 10.0 * margins]
        )

    def _margins(self, outing: Outing) -> tuple[_Array, _Array]:
        """Return (m, e) logarithms of the margins of all ends' legs, and kg at their arrivals."""
        m, n = len(outing.t), len(self._ends)
        here, there = np.empty((n, m, 6)), np.empty((n, m, 6))
        tof, m0 = np.empty((n, m)), np.empty((n, m))
        for k, end in enumerate(self._ends):
            hers, goal = outing.states[:, end.step], np.tile(self._goals[k], (m, 1))
            here[k], there[k] = (hers, goal) if end.first else (goal, hers)
            tof[k] = np.abs(outing.t[:, end.step] - end.t_mjd2000)
            m0[k] = end.m0_kg
        known = np.isfinite(here).all(axis=2) & np.isfinite(there).all(axis=2) & (tof > 1.0)
        legs = Legs(
            rv_dep=here[known],
            rv_arr=there[known],
            tof_days=tof[known],
            m0=m0[known],
            thrust=self._craft.thrust,
            isp=self._craft.isp,
            m_dry=0.0,
        )
        margins, masses = np.full((n, m), _NO_LEG), np.zeros((n, m))
        with np.errstate(divide="ignore", invalid="ignore"):
            margins[known] = np.nan_to_num(np.log(self._predictor.margin(legs)), nan=_NO_LEG)
        masses[known] = np.nan_to_num(self._predictor.final_mass(legs), nan=0.0)
        return margins.T + self._offsets, masses.T


def _gap(before: Step, after: Step) -> float:
    """Return the least time between two steps in days."""
    probes = [step for step in (before, after) if step.probe >= 0]
    if len(probes) != 1:
        return 0.0
    if before.act is Act.CAPTURE and before.stays:
        return LATE_DAYS
    return LEAD_DAYS if probes[0].free and not probes[0].stays else TOUCH_DAYS


def _retimed(
    screen: Screen,
    problem: RendezvousProblem,
    crew: Crew,
    schedule: Schedule,
    x: _Array,
) -> Crew | None:
    """Return the crew on a schedule's course, its tours retimed; None where one fails."""
    trial = replace(crew, course=schedule.course(x))
    epochs = schedule.epochs(x[None])[0]
    flights = list(crew.flights)
    for number, flight in enumerate(crew.flights):
        changed = [
            (k, step)
            for k, step in enumerate(schedule.steps)
            if step.probe == number and step.free and not step.stays
        ]
        if not changed:
            continue
        found = _retimed_probe(
            problem, trial, number, flight, [(epochs[k], s) for k, s in changed]
        )
        if found is None:
            return None
        flights[number] = found
    trial = replace(trial, flights=tuple(flights))
    return trial if carrier_of(screen, trial) is not None else None


def _retimed_probe(
    problem: RendezvousProblem,
    crew: Crew,
    number: int,
    flight: Flight,
    changed: list[tuple[float, Step]],
) -> Flight | None:
    itinerary = flight.itinerary
    t_dep, tof = itinerary.t_dep_mjd2000.copy(), itinerary.tof_days.copy()
    for epoch, step in changed:
        if step.act is Act.RELEASE:
            t_dep[0], tof[0] = epoch, itinerary.t_arr_mjd2000[0] - epoch
        else:
            tof[-1] = epoch - t_dep[-1]
    own = own_problem(problem, crew, number)
    moved = replace(itinerary, t_dep_mjd2000=t_dep, tof_days=tof)
    retimed = retime(own, moved, max_iterations=_ITERATIONS)
    found = None if retimed is None else _not_early(own, crew, number, retimed.flight)
    return found if found is not None and found.keeps_rules(own) else None


def _not_early(own: RendezvousProblem, crew: Crew, number: int, flight: Flight) -> Flight | None:
    """Return a flight that ends on the coast it is meant for: its last leg may take longer."""
    assert crew.course is not None
    itinerary = flight.itinerary
    begin, _ = crew.course.window(crew.course.ends[number])
    late = begin + TOUCH_DAYS - float(itinerary.t_arr_mjd2000[-1])
    if late <= 0.0:
        return flight
    tof = itinerary.tof_days.copy()
    tof[-1] += late
    return fly(own, replace(itinerary, tof_days=tof))
