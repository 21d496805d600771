"""What a predictor expects of launches, self-fly-bys and transfers from one node."""

from collections.abc import Callable
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.classifier.predictor import LegPredictor
from seqsearch.core.margin_curves import MarginCurves
from seqsearch.problems.gtoc5.leg_maker import LegMaker
from seqsearch.problems.gtoc5.self_fly_by import shortest_self_fly_by_days
from seqsearch.problems.gtoc5.transfer_plans import TransferPlans
from seqsearch.problems.moves.directions import even_directions
from seqsearch.problems.moves.lambert_departure import lambert_departure
from seqsearch.problems.moves.questions import Questions
from seqsearch.settings import SearchSettings

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

FLY_BY_STRETCH: Final = 1.15
"""Time of a self-fly-by over the shortest: 15 % more time saves 30 % of its propellant."""

_DIRECTIONS: Final = 24
"""Directions of a fly-by on half of the sphere: some 25 degrees apart, worth 5 of 400 m/s."""

_FLY_BY_TIMES: Final = np.array([0.75, 0.9, 1.05, 1.25, 1.5, 1.8])
"""Times of a self-fly-by that are asked about, over the closed form's."""

_KNOTS: Final = 16
"""Flight times of a transfer that are asked about."""

_TARGETS: Final = 60
"""Targets of a node that are looked at closely: those that rest to rest is shortest to."""

_CLOSE_CALL: Final = -0.3
"""log(m*/m0) of a transfer from rest that a fly-by in a good direction may make flyable."""

_TIME_EXPONENT: Final = 1.3
"""Rough d log(m*) / d log(time) of a transfer."""

_FINALISTS: Final = 3
"""Directions of a fly-by for which the margin is asked over the flight time."""

_LEVELS: Final = (0.02, 0.12, 0.3, 0.55, 0.85)
"""log(m*/m0) of the flights to a target: the shortest, and longer ones that save propellant."""


@final
class Gtoc5Forecast:
    """Finds the promising hops from a node.

    Parameters
    ----------
    maker : LegMaker
        Makes the legs.
    points : (n, 5) float64, m/s
        The bodies in the space of the elements, see `phase_free_points`.
    predictor : LegPredictor
        Predicts the legs; a `QuickPredictor` gives its quick answers first.
    settings : SearchSettings
        `neighbours`: bodies looked at, the nearest in the space of the elements;
        `tof_days_min` and `tof_days_max`, of transfers alone.
    """

    def __init__(
        self,
        maker: LegMaker,
        points: _Array,
        predictor: LegPredictor,
        settings: SearchSettings,
    ) -> None:
        self._maker = maker
        self._ask = Questions(predictor)
        self._settings = settings
        self._points = points
        self._directions = even_directions(_DIRECTIONS)

    @property
    def questions(self) -> int:
        """Legs that the predictor was asked about so far."""
        return self._ask.count

    def launches(self, row: int, t: float, mass: float) -> TransferPlans | None:
        """Return transfers from the Earth to first asteroids, launched along Lambert's arc.

        Parameters
        ----------
        row : int
            Catalogue row of the Earth.
        t : float
            Epoch of the launch, MJD2000.
        mass : float
            Mass at the launch, kg.
        """
        target = self._nearest(row, np.array([row]))

        def legs(pair: _Rows, tof: _Array) -> Legs:
            velocity = self._launch_velocity(row, t, target[pair], tof)
            return self._transfers(row, t, velocity, target[pair], tof, mass)

        curves = self._curves(np.arange(len(target)), legs)
        best = _earliest(curves.shortest(0.0), _TARGETS)
        found = self._timed(curves.take(best), lambda pair, tof: legs(best[pair], tof))
        if found is None:
            return None
        pair, tof = found
        rows = target[best[pair]]
        return TransferPlans(
            target=rows,
            fly_by_days=np.zeros(len(rows)),
            velocity=self._launch_velocity(row, t, rows, tof),
            tof_days=tof,
        )

    def hops(self, row: int, t: float, mass: float, visited: _Rows) -> TransferPlans | None:
        """Return hops from rest at an asteroid, past it in a fly-by, to rest at others.

        Parameters
        ----------
        row : int
            Catalogue row of the asteroid.
        t : float
            Epoch of the departure, MJD2000.
        mass : float
            Mass at the departure, kg.
        visited : (k,) intp
            Rows of the bodies that are no targets.
        """
        wait = self.fly_by_days(row, t, mass)
        if not np.isfinite(wait).any():
            return None
        left = float(self._maker.mass_after_fly_by(mass, FLY_BY_STRETCH))
        velocity = self._maker.fly_by_speed_m_s * self._directions
        target = self._nearest(row, visited)
        t_rest = t + float(np.nanmin(wait))

        def at_rest(pair: _Rows, tof: _Array) -> Legs:
            return self._transfers(row, t_rest, np.zeros((len(tof), 3)), target[pair], tof, left)

        curves = self._curves(np.arange(len(target)), at_rest)
        near = _earliest(curves.shortest(_CLOSE_CALL), _TARGETS)
        if len(near) == 0:
            return None
        target = target[near]
        guess = curves.take(near).shortest(_CLOSE_CALL)
        finalist = self._directions_for(row, t, target, guess, left, wait)

        # One curve for each pair of target and direction; the soonest arrival decides.
        pair = np.repeat(np.arange(len(target)), _FINALISTS)
        course = finalist.ravel()

        def legs(option: _Rows, tof: _Array) -> Legs:
            j = course[option]
            return self._transfers(row, t + wait[j], velocity[j], target[pair[option]], tof, left)

        curves = self._curves(np.arange(len(pair)), legs)
        arrival = (wait[course] + curves.shortest(_LEVELS[0])).reshape(-1, _FINALISTS)
        arrival = np.where(np.isfinite(arrival), arrival, np.inf)
        option = np.arange(len(target)) * _FINALISTS + arrival.argmin(axis=1)
        option = option[np.isfinite(arrival.min(axis=1))]
        found = self._timed(curves.take(option), lambda k, tof: legs(option[k], tof))
        if found is None:
            return None
        k, tof = found
        chosen = option[k]
        return TransferPlans(
            target=target[pair[chosen]],
            fly_by_days=wait[course[chosen]],
            velocity=velocity[course[chosen]],
            tof_days=tof,
        )

    def fly_by_days(self, row: int, t: float, mass: float) -> _Array:
        """Return (d,) days that a self-fly-by takes in each direction; inf for too long."""
        closed_form = float(
            shortest_self_fly_by_days(
                mass, self._maker.fly_by_speed_m_s, self._maker.spacecraft.thrust
            )
        )
        # Forth and back are the same in the linear motion about a body: half of the sphere do.
        velocity = self._maker.fly_by_speed_m_s * self._directions[:_DIRECTIONS]
        n = len(velocity)
        tof = FLY_BY_STRETCH * closed_form * _FLY_BY_TIMES
        legs = self._maker.self_fly_bys(
            np.full(n * len(tof), row),
            np.full(n * len(tof), t),
            np.repeat(velocity, len(tof), axis=0),
            np.tile(tof, n),
            np.full(n * len(tof), mass),
        )
        reserve = self._ask.quick_log_margin(legs).reshape(n, len(tof)) - np.log(FLY_BY_STRETCH)
        return np.tile([_crossing(tof, line) for line in reserve], 2)

    def _launch_velocity(self, row: int, t: float, target: _Rows, tof: _Array) -> _Array:
        n = len(target)
        return lambert_departure(
            self._maker.catalogue,
            np.full(n, row),
            np.full(n, t),
            target,
            tof,
            least_m_s=0.0,
            most_m_s=self._maker.rules.launch_speed_max_m_s,
        )

    def _transfers(
        self,
        row: int,
        t: float | _Array,
        velocity: _Array,
        target: _Rows,
        tof: _Array,
        mass: float,
    ) -> Legs:
        n = len(tof)
        return self._maker.transfers(
            np.full(n, row), np.full(n, 1.0) * t, velocity, target, tof, np.full(n, mass)
        )

    def _nearest(self, row: int, visited: _Rows) -> _Rows:
        """Return the rows of the nearest bodies in the space of the elements, not visited."""
        distance = np.linalg.norm(self._points - self._points[row], axis=1)
        distance[visited] = np.inf
        order: _Rows = np.argsort(distance, kind="stable")[: self._settings.neighbours]
        near: _Rows = order[np.isfinite(distance[order])]
        return near

    def _curves(self, pair: _Rows, legs: Callable[[_Rows, _Array], Legs]) -> MarginCurves:
        """Return the margin of each pair over the flight time, by quick answers."""
        first = np.full(len(pair), self._settings.tof_days_min)
        last = np.full(len(pair), self._settings.tof_days_max)
        return self._ask.curves(pair, first, last, _KNOTS, legs)

    def _directions_for(
        self, row: int, t: float, target: _Rows, tof: _Array, mass: float, wait: _Array
    ) -> NDArray[np.intp]:
        """Return (n, finalists) directions by which each target seems to be reached soonest."""
        open_ = np.flatnonzero(np.isfinite(wait))
        velocity = self._maker.fly_by_speed_m_s * self._directions[open_]
        n, d = len(target), len(open_)
        legs = self._transfers(
            row,
            np.tile(t + wait[open_], n),
            np.tile(velocity, (n, 1)),
            np.repeat(target, d),
            np.repeat(tof, d),
            mass,
        )
        log_margin = self._ask.quick_log_margin(legs).reshape(n, d)
        arrival = wait[open_] + tof[:, None] * np.exp(-log_margin / _TIME_EXPONENT)
        order = np.argsort(arrival, axis=1, kind="stable")[:, :_FINALISTS]
        # Fewer open directions than finalists: the best one stands in for the missing.
        order = np.pad(order, ((0, 0), (0, _FINALISTS - order.shape[1])), mode="edge")
        chosen: _Rows = open_[order]
        return chosen

    def _timed(
        self, curves: MarginCurves, legs: Callable[[_Rows, _Array], Legs]
    ) -> tuple[_Rows, _Array] | None:
        """Return pairs and flight times at each level of margin, by good answers, or None."""
        shortest = curves.shortest(_LEVELS[0])
        known = np.flatnonzero(np.isfinite(shortest))
        if len(known) == 0:
            return None
        curves, shortest = curves.take(known), shortest[known]
        curves = self._ask.corrected(curves, shortest, legs(known, shortest))
        times = np.column_stack([curves.shortest(level) for level in _LEVELS])
        k, level = np.nonzero(np.isfinite(times))
        return (known[k], times[k, level]) if len(k) else None


def _earliest(times: _Array, count: int) -> _Rows:
    """Return the positions of the smallest finite times."""
    order = np.argsort(times, kind="stable")[:count]
    return order[np.isfinite(times[order])]


def _crossing(x: _Array, y: _Array) -> float:
    """Return the first x at which y reaches zero, linear between the points; inf for none."""
    reached = np.flatnonzero(y >= 0.0)
    if len(reached) == 0:
        return float(np.inf)
    k = int(reached[0])
    if k == 0:
        return float(x[0])
    share = -y[k - 1] / (y[k] - y[k - 1])
    return float(x[k - 1] + share * (x[k] - x[k - 1]))
