"""What a predictor expects of launches and transfers from one node.

Three rounds, each about fewer targets and with better answers: a few quick
questions over the flight times that are possible at all; a curve of quick
answers for those that seem to lead to the best tours; and good answers for the
flight times that are proposed.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.classifier.predictor import LegPredictor, QuickPredictor
from seqsearch.core.margin_curves import MarginCurves, flight_times
from seqsearch.problems.gtoc2.outlook import Outlook
from seqsearch.problems.moves.directions import even_directions
from seqsearch.problems.moves.lambert_departure import lambert_departure
from seqsearch.settings import SearchSettings

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

_COARSE: Final = 5
_FINE: Final = 14
"""Flight times that are asked about in the first two rounds."""

_LOOKED_AT: Final = 36
"""Targets of the second round."""

_PURSUED: Final = 16
"""Targets of the third."""

_LEVELS: Final = (0.01, 0.05, 0.12, 0.25)
"""log(m*/m0) of the ways to a target: the shortest, and longer ones that save propellant."""

_CLOSE_CALL: Final = -0.1
"""log(m*/m0) by coarse answers that may be 0 in fact."""

_SOONEST: Final = 0.75
"""Shortest flight time that is asked about, over what the difference of the orbits needs."""

_SPREAD: Final = 3.5
_SPREAD_DAYS: Final = 120.0
"""Longest flight time that is asked about, over the shortest and in addition."""

_LAUNCH_TARGETS: Final = 40
_DIRECTIONS: Final = 12
_LAUNCH_DAYS: Final = (80.0, 900.0)
_LAUNCH_COARSE: Final = 6

_NOWHERE: Final = -5.0
"""log(m*/m0) of legs of which nothing is known."""


@final
@dataclass(frozen=True, eq=False)
class Ways:
    """Ways from a node to next visits, one row a way.

    With n the number of ways.

    Attributes
    ----------
    target : (n,) intp
        Catalogue row of the body.
    legs : Legs
        The n legs.
    m_final : (n,) float64, kg
        Predicted masses at arrival.
    """

    target: _Rows
    legs: Legs
    m_final: _Array


@final
class Gtoc2Forecast:
    def __init__(self, problem, outlook: Outlook, predictor: LegPredictor, settings: SearchSettings):
        self._problem = problem
        self._outlook = outlook
        self._predictor = predictor
        self._quick = predictor.quick_margin if isinstance(predictor, QuickPredictor) else predictor.margin
        self._settings = settings
        self.questions = 0

    def ways(self, row: int, t: float, mass: float, elapsed: float, left: int) -> Ways | None:
        """left: set of groups still to visit (bits)."""
        problem, outlook, settings = self._problem, self._outlook, self._settings
        launch = row == 0
        if launch:
            return self.launches(t, mass, left)
        target = np.flatnonzero(outlook.wanted(left))
        after = outlook.left_after(left, target)
        need = outlook.delta_v[row, target]
        if launch:
            need = np.maximum(need - problem.rules.launch_speed_max_m_s, 0.0)
        shortest = outlook.burn_days(mass, need)

        def value(at: _Rows, tof: _Array, m_final: _Array) -> _Array:
            return outlook.value(target[at], after[at], elapsed + tof, m_final)

        def full_burn(tof: _Array) -> _Array:
            return mass - outlook.kg_per_day * tof

        every = np.arange(len(target))
        guess = value(every, shortest, mass * np.exp(-need / outlook.exhaust))
        near = np.argsort(-guess, kind="stable")[: settings.neighbours]
        target, after, shortest = target[near], after[near], shortest[near]
        first = np.clip(_SOONEST * shortest, settings.tof_days_min, 0.9*settings.tof_days_max)
        last = np.minimum(_SPREAD * first + _SPREAD_DAYS, settings.tof_days_max)

        def legs(at: _Rows, tof: _Array) -> Legs:
            velocity = self._launch_velocity(t, target[at], tof) if launch else None
            return problem.legs(row, t, velocity, target[at], tof, mass)

        def curves(at: _Rows, knots: int) -> MarginCurves:
            tof = flight_times(first[at], last[at], knots)
            answers = self._log_margin(legs(np.repeat(at, knots), tof.ravel()))
            return MarginCurves.through(first[at], last[at], answers.reshape(tof.shape))

        def best(at: _Rows, tof: _Array, count: int) -> _Rows:
            v = np.where(np.isfinite(tof), value(at, tof, full_burn(tof)), -np.inf)
            order = np.argsort(-v, kind="stable")[:count]
            return order[np.isfinite(v[order])]

        at = np.arange(len(target))
        if len(at) > _LOOKED_AT:
            coarse = curves(at, _COARSE).shortest(_CLOSE_CALL)
            at = at[best(at, coarse, _LOOKED_AT)]
            if len(at) == 0:
                return None
        fine = curves(at, _FINE)
        soonest = fine.shortest(_LEVELS[0])
        chosen = best(at, soonest, _PURSUED)
        if len(chosen) == 0:
            return None
        at, fine, soonest = at[chosen], fine.take(chosen), soonest[chosen]
        self.questions += len(at)
        with np.errstate(invalid="ignore", divide="ignore"):
            answer = np.log(self._predictor.margin(legs(at, soonest)))
        fine = fine.corrected(soonest, answer)
        times = np.column_stack([fine.shortest(level) for level in _LEVELS])
        k, level = np.nonzero(np.isfinite(times))
        if len(k) == 0:
            return None
        at, tof = at[k], times[k, level]
        chain = legs(at, tof)
        self.questions += len(chain)
        m_final = self._predictor.final_mass(chain)
        return Ways(target[at], chain, m_final)

    def launches(self, t: float, mass: float, left: int) -> Ways | None:
        problem, outlook, settings = self._problem, self._outlook, self._settings
        speed = problem.rules.launch_speed_max_m_s
        target = np.flatnonzero(outlook.wanted(left))
        after = outlook.left_after(left, target)
        need = np.maximum(outlook.delta_v[0, target] - speed, 0.0)
        soon = outlook.burn_days(mass, need)
        guess = outlook.value(target, after, soon + 100.0, mass * np.exp(-need / outlook.exhaust))
        near = np.argsort(-guess, kind="stable")[: _LAUNCH_TARGETS]
        target, after = target[near], after[near]
        n = len(target)
        courses = speed * even_directions(_DIRECTIONS)
        d = len(courses)
        knots = np.exp(np.linspace(np.log(_LAUNCH_DAYS[0]), np.log(_LAUNCH_DAYS[1]), _LAUNCH_COARSE))
        first, last = np.full(n, knots[0]), np.full(n, knots[-1])

        def legs(velocity, at, tof) -> Legs:
            return problem.legs(0, t, velocity, target[at], tof, mass)

        # round 1: every direction
        at = np.repeat(np.arange(n), len(knots) * d)
        tof = np.tile(np.repeat(knots, d), n)
        ask = self._log_margin(legs(np.tile(courses, (n * len(knots), 1)), at, tof)).reshape(n, len(knots), d)
        pa, pt = np.repeat(np.arange(n), len(knots)), np.tile(knots, n)
        arcs = self._log_margin(legs(self._launch_velocity(t, target[pa], pt), pa, pt)).reshape(n, len(knots))
        envelope = np.maximum(ask.max(axis=2), arcs)
        soonest = MarginCurves.through(first, last, envelope).shortest(-0.1)
        v = np.where(np.isfinite(soonest), outlook.value(target, after, soonest, mass - outlook.kg_per_day * soonest), -np.inf)
        order = np.argsort(-v, kind="stable")[:_LOOKED_AT]
        order = order[np.isfinite(v[order])]
        if len(order) == 0:
            return None
        # round 2: curves of finalists
        knot = np.abs(np.log(knots) - np.log(soonest[order])[:, None]).argmin(axis=1)
        tops = np.argsort(-ask[order, knot], axis=1, kind="stable")[:, :2]
        m = len(order)
        pair = np.repeat(order, 3)
        course = np.column_stack([tops, np.full(m, -1)]).ravel()
        lo = np.maximum(0.55 * soonest[pair], _LAUNCH_DAYS[0])
        hi = np.minimum(2.2 * soonest[pair] + 60.0, _LAUNCH_DAYS[1])

        def velocity(k, tof):
            lam = self._launch_velocity(t, target[pair[k]], tof)
            return np.where((course[k] >= 0)[:, None], courses[course[k]], lam)

        tofs = flight_times(lo, hi, 12)
        k = np.repeat(np.arange(len(pair)), 12)
        values = self._log_margin(legs(velocity(k, tofs.ravel()), pair[k], tofs.ravel()))
        curves = MarginCurves.through(lo, hi, values.reshape(tofs.shape))
        soonest = curves.shortest(_LEVELS[0])
        v = np.where(np.isfinite(soonest), outlook.value(target[pair], after[pair], soonest, mass - outlook.kg_per_day * soonest), -np.inf).reshape(m, 3)
        way = np.arange(m) * 3 + v.argmax(axis=1)
        v = v.max(axis=1)
        o = np.argsort(-v, kind="stable")[:_PURSUED]
        way = way[o[np.isfinite(v[o])]]
        if len(way) == 0:
            return None
        curves, soonest = curves.take(way), soonest[way]
        self.questions += len(way)
        with np.errstate(invalid="ignore", divide="ignore"):
            answer = np.log(self._predictor.margin(legs(velocity(way, soonest), pair[way], soonest)))
        curves = curves.corrected(soonest, answer)
        times = np.column_stack([curves.shortest(level) for level in _LEVELS])
        j, level = np.nonzero(np.isfinite(times))
        if len(j) == 0:
            return None
        k, tof = way[j], times[j, level]
        v0 = velocity(k, tof)
        for angle in (15.0, 7.0):
            v0 = self._turned(v0, np.radians(angle), lambda vel, i: legs(vel, pair[k[i]], tof[i]), speed)
        chain = legs(v0, pair[k], tof)
        self.questions += len(chain)
        return Ways(target[pair[k]], chain, self._predictor.final_mass(chain))

    def _turned(self, velocity, angle, legs, speed):
        """Ask around each direction, at full speed, and return the best."""
        n = len(velocity)
        unit = velocity / np.maximum(np.linalg.norm(velocity, axis=1), 1e-9)[:, None]
        helper = np.where(np.abs(unit[:, 2:]) < 0.8, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
        u = np.cross(unit, helper)
        u /= np.linalg.norm(u, axis=1)[:, None]
        w = np.cross(unit, u)
        phi = np.arange(6) * np.pi / 3
        ring = np.cos(angle) * unit[:, None] + np.sin(angle) * (np.cos(phi)[:, None] * u[:, None] + np.sin(phi)[:, None] * w[:, None])
        options = np.concatenate([velocity[:, None], speed * unit[:, None], speed * ring], axis=1)
        c = options.shape[1]
        i = np.repeat(np.arange(n), c)
        ask = self._log_margin(legs(options.reshape(-1, 3), i)).reshape(n, c)
        return options[np.arange(n), ask.argmax(axis=1)]

    def _launch_velocity(self, t: float, target: _Rows, tof: _Array) -> _Array:
        n = len(target)
        return lambert_departure(
            self._problem.catalogue, np.zeros(n, dtype=np.intp), np.full(n, t), target, tof,
            least_m_s=0.0, most_m_s=self._problem.rules.launch_speed_max_m_s,
        )

    def _log_margin(self, legs: Legs) -> _Array:
        self.questions += len(legs)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.nan_to_num(np.log(self._quick(legs)), nan=_NOWHERE, neginf=_NOWHERE)
