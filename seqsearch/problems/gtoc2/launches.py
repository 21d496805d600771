"""Launches from the Earth, in the directions that help most.

Lambert's arc is a good direction where a launch leads straight to its target, and a poor
one for a launch whose engine shapes an orbit for a revolution and more. Directions over
the whole sphere are therefore asked about first, and the best ones turned a little.
"""

from collections.abc import Callable
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.orbits import Catalogue
from seqsearch.core.margin_curves import MarginCurves, flight_times
from seqsearch.problems.gtoc2.plans import LEVELS, Plans, at_levels
from seqsearch.problems.gtoc2.prospects import Pairs, Prospects
from seqsearch.problems.moves.directions import even_directions, ring_around
from seqsearch.problems.moves.lambert_departure import lambert_departure
from seqsearch.problems.moves.questions import Questions

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

_TARGETS: Final = 30
_PURSUED: Final = 12
"""Targets of a launch epoch before and after its directions are known."""

_DIRECTIONS: Final = 6
"""Directions on half of the sphere, some 50 degrees apart."""

_TURNS_RAD: Final = (0.5, 0.25, 0.12)
_AROUND: Final = 6
"""Angles by which the best direction is turned, one after another, each to so many sides."""

_TIMES: Final = (80.0, 900.0)
_COARSE: Final = 5
_FINE: Final = 12
"""Flight times that are asked about: the first and last one in days, and how many."""

_AROUND_SOONEST: Final = (0.6, 2.0)
"""Flight times of the second round, over the shortest of the first."""

_CLOSE_CALL: Final = -0.15
"""log(m*/m0) in the best of some directions that may be 0 in a better one."""


@final
class Launches:
    """Plans launches.

    Parameters
    ----------
    prospects : Prospects
        The nodes, and which targets are worth questions.
    legs : callable
        Makes the legs of plans.
    questions : Questions
        Asks the predictor.
    catalogue : Catalogue
        The bodies.
    speed_max_m_s : float
        Largest excess speed.
    """

    def __init__(
        self,
        prospects: Prospects,
        legs: Callable[[Plans], Legs],
        questions: Questions,
        catalogue: Catalogue,
        speed_max_m_s: float,
    ) -> None:
        self._prospects = prospects
        self._legs = legs
        self._questions = questions
        self._catalogue = catalogue
        self._speed = speed_max_m_s

    def plans(self, block: _Rows) -> Plans:
        """Return launches from some nodes, at several flight times for each target."""
        prospects = self._prospects
        pairs = prospects.pairs(block, self._speed, _TARGETS)
        soonest, velocity = self._directed(pairs)
        chosen = prospects.best(pairs, soonest, _PURSUED)
        pairs, soonest, velocity = pairs.take(chosen), soonest[chosen], velocity[chosen]
        for angle in _TURNS_RAD:
            velocity = self._turned(pairs, soonest, velocity, angle)
        curves = self._curves(pairs, soonest, velocity)
        soonest = curves.shortest(LEVELS[0])
        known = np.flatnonzero(np.isfinite(soonest))
        pairs, curves, soonest = pairs.take(known), curves.take(known), soonest[known]
        velocity = self._or_arc(pairs, soonest, velocity[known])
        curves = self._questions.corrected(
            curves, soonest, self._legs(_planned(pairs, velocity, soonest))
        )
        k, tof = at_levels(curves)
        pairs = pairs.take(k)
        velocity = self._or_arc(pairs, tof, velocity[k])
        return _planned(pairs, self._turned(pairs, tof, velocity, _TURNS_RAD[-1]), tof)

    def _directed(self, pairs: Pairs) -> tuple[_Array, _Array]:
        """Return (n,) days and (n, 3) velocities with which targets seem to be reached soonest.

        NaN days where they seem out of reach.
        """
        n = len(pairs)
        times = np.geomspace(*_TIMES, _COARSE)
        pair, tof = np.repeat(np.arange(n), _COARSE), np.tile(times, n)
        arcs = self._arcs(pairs.take(pair), tof)
        sphere = self._speed * even_directions(_DIRECTIONS)
        options = np.concatenate(
            [arcs[:, None], np.broadcast_to(sphere, (len(pair), *sphere.shape))], axis=1
        )
        log_margin, best = self._best_of(pairs.take(pair), tof, options)
        first, last = np.full(n, times[0]), np.full(n, times[-1])
        curves = MarginCurves.through(first, last, log_margin.reshape(n, _COARSE))
        soonest = curves.shortest(_CLOSE_CALL)
        away = np.abs(np.log(times) - np.log(np.nan_to_num(soonest, nan=times[0]))[:, None])
        return soonest, best.reshape(n, _COARSE, 3)[np.arange(n), away.argmin(axis=1)]

    def _curves(self, pairs: Pairs, soonest: _Array, velocity: _Array) -> MarginCurves:
        """Return the margins over the flight time, with velocities or along Lambert's arcs."""
        first, last = (np.clip(soonest * factor, *_TIMES) for factor in _AROUND_SOONEST)
        tof = flight_times(first, last, _FINE)
        k = np.repeat(np.arange(len(pairs)), _FINE)
        arcs = self._arcs(pairs.take(k), tof.ravel())
        options = np.stack([velocity[k], arcs], axis=1)
        log_margin, _ = self._best_of(pairs.take(k), tof.ravel(), options)
        return MarginCurves.through(first, last, log_margin.reshape(tof.shape))

    def _or_arc(self, pairs: Pairs, tof_days: _Array, velocity: _Array) -> _Array:
        """Return (n, 3) the better of velocities and those along Lambert's arcs."""
        options = np.stack([velocity, self._arcs(pairs, tof_days)], axis=1)
        return self._best_of(pairs, tof_days, options)[1]

    def _arcs(self, pairs: Pairs, tof_days: _Array) -> _Array:
        """Return (n, 3) m/s along Lambert's arcs."""
        nodes = self._prospects.nodes
        return lambert_departure(
            self._catalogue,
            nodes.row[pairs.parent],
            nodes.t_ready_mjd2000[pairs.parent],
            pairs.target,
            tof_days,
            least_m_s=0.0,
            most_m_s=self._speed,
        )

    def _turned(
        self, pairs: Pairs, tof_days: _Array, velocity: _Array, angle_rad: float
    ) -> _Array:
        """Return (n, 3) the best of velocities, the same at full speed, and those around them."""
        speed = np.linalg.norm(velocity, axis=1)
        # A launch at rest may go anywhere.
        unit = np.where(
            speed[:, None] > 0.0, velocity / np.maximum(speed, 1e-9)[:, None], [1.0, 0.0, 0.0]
        )
        ring = ring_around(unit, angle_rad, _AROUND)
        faster = self._speed * np.concatenate([unit[:, None], ring], axis=1)
        return self._best_of(pairs, tof_days, np.concatenate([velocity[:, None], faster], axis=1))[
            1
        ]

    def _best_of(self, pairs: Pairs, tof_days: _Array, options: _Array) -> tuple[_Array, _Array]:
        """Return (n,) log(m*/m0) and (n, 3) velocities: the best of (n, c, 3) options."""
        n, c = options.shape[:2]
        k = np.repeat(np.arange(n), c)
        plans = _planned(pairs.take(k), options.reshape(-1, 3), tof_days[k])
        answers = self._questions.quick_log_margin(self._legs(plans)).reshape(n, c)
        best = answers.argmax(axis=1)
        return answers[np.arange(n), best], options[np.arange(n), best]


def _planned(pairs: Pairs, velocity: _Array, tof_days: _Array) -> Plans:
    return Plans(pairs.parent, pairs.target, velocity, tof_days)
