"""Extending a tour at either end: new bodies before its first or after its last.

A small beam search on the predictor alone. Bodies near in the orbital metric
are priced by Lambert arcs over a grid of flight times; for the best of them
the shortest flight time that the predictor thinks flyable is found. Backward
it works the same, with masses guessed from the burn of the kept part, as
retiming sets them right afterwards.

Bodies *between* two kept ones are not tried: each gap of a good tour is tuned
at both sides. On two GTOC7 tours of 14 asteroids, the best other body in one
of the middle gaps made the least duration 2600 days longer, the best other
body at an end 20 days.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.classifier.predictor import LegPredictor
from feasibility.constants import DAY_S
from feasibility.orbits import OrbitalNeighbours
from feasibility.orbits.lambert import lambert_delta_v
from seqsearch.core.ending import ending_of, fixed_start, rows_to_avoid
from seqsearch.core.problem import Problem
from seqsearch.polish.flight import Flight
from seqsearch.polish.itinerary import Itinerary, excess_speeds

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]

_OVERLOAD_DAYS: Final = 100.0
"""Days that an overload of one costs: a per cent of m* is about a day of flight time."""

_LEISURE: Final = (1.0, 1.12)
"""Flight times that are tried, as multiples of the shortest flyable: slower legs burn less."""

_MARGIN: Final = 0.003
"""Logarithm of the predicted margin that a leg is to have: the predictor's error."""

_THRUST_SHARE: Final = 0.8
"""Share of the flight time that the engine runs, for masses guessed backward."""

_BUCKET_DAYS: Final = 60.0
"""Wide buckets: an extension sees each epoch once, and a tree of all bodies costs 20 ms."""

_TIES_DAYS: Final = np.geomspace(50.0, 480.0, 16)
"""Flight times that are tried to a fixed end, and from a fixed start."""

_MAX_PER_BODY: Final = 2
_LARGEST_OVERLOAD: Final = 0.5


@final
@dataclass(frozen=True)
class Extension:
    """Which part of a tour is kept, and how many new bodies it gets.

    Attributes
    ----------
    first, last : int
        Positions of the first and the last body that are kept.
    before, after : int
        New bodies before and after; one of the two is zero. A fixed start or end that is not
        kept comes on top.
    """

    first: int
    last: int
    before: int
    after: int


@final
@dataclass(frozen=True)
class ExtensionSettings:
    """How thoroughly extensions are looked for.

    Attributes
    ----------
    width : int
        Nodes of the beam.
    neighbours : int
        Bodies that are priced for each node.
    predicted : int
        Bodies of each node about which the predictor is asked.
    results : int
        Itineraries returned at most.
    tofs_days : tuple of float
        Grid of flight times, ascending.
    reference_tof_days : float
        Flight time of the orbital metric.
    propellant_days_per_kg : float
        What a kilogram of propellant is worth in days: 0.35 is typical at the
        optimum of GTOC7 tours.
    """

    width: int = 20
    neighbours: int = 40
    predicted: int = 6
    results: int = 3
    tofs_days: tuple[float, ...] = (50.0, 70.0, 90.0, 110.0, 135.0, 165.0, 200.0, 240.0)
    reference_tof_days: float = 120.0
    propellant_days_per_kg: float = 0.35


@final
@dataclass(frozen=True, eq=False)
class _Nodes:
    """Partial extensions, n of them with d bodies, in the order in which they were added.

    Attributes
    ----------
    rows : (n, d + 1) intp
        The kept body first.
    t_dep, tof : (n, d) float64
        Departure epoch and flight time of each leg.
    clock : (n,) float64
        Forward: epoch at which the last body may be left; backward: epoch at
        which it has to be reached.
    mass : (n,) float64, kg
        Mass at that epoch.
    """

    rows: _Index
    t_dep: _Array
    tof: _Array
    clock: _Array
    mass: _Array

    def take(self, index: _Index) -> "_Nodes":
        return _Nodes(
            self.rows[index],
            self.t_dep[index],
            self.tof[index],
            self.clock[index],
            self.mass[index],
        )


@final
class Extender:
    """Extends tours of one problem.

    Parameters
    ----------
    problem : Problem
        Bodies, stays, spacecraft.
    predictor : LegPredictor
        Asked in batches of some thousand legs.
    settings : ExtensionSettings, optional
        How thoroughly.
    """

    def __init__(
        self,
        problem: Problem,
        predictor: LegPredictor,
        settings: ExtensionSettings | None = None,
    ) -> None:
        self._problem = problem
        self._predictor = predictor
        self._settings = settings or ExtensionSettings()
        self._neighbours = OrbitalNeighbours(
            problem.catalogue,
            reference_tof_days=self._settings.reference_tof_days,
            bucket_days=_BUCKET_DAYS,
        )
        ending = ending_of(problem)
        self._end = None if ending is None else ending.row
        self._start = fixed_start(problem)
        self._avoid = rows_to_avoid(problem)
        self._launch, self._arrival = excess_speeds(problem)

    def extend(self, flight: Flight, extension: Extension, *, avoid: _Index) -> list[Itinerary]:
        """Return the kept part with new bodies, the most promising itineraries first.

        Parameters
        ----------
        flight : Flight
            The tour.
        extension : Extension
            What is kept of it and what it gets.
        avoid : (k,) intp
            Catalogue rows that are not visited, besides those that are kept.
        """
        base, problem = flight.itinerary, self._problem
        kept = base.part(extension.first, extension.last)
        avoid = np.union1d(np.union1d(kept.rows, avoid), self._avoid)
        backward = extension.first > 0 or extension.before > 0
        steps = extension.before if backward else extension.after
        nodes = self._begin(flight, extension, backward)
        for step in range(steps):
            if len(nodes.clock):
                is_start = backward and step == steps - 1 and self._start is None
                nodes = self._extend(nodes, avoid, backward, is_start)
        fixed = self._start if backward else self._end
        if fixed is not None and kept.rows[0 if backward else -1] != fixed and len(nodes.clock):
            nodes = self._tied(nodes, fixed, backward)
        if not len(nodes.clock):
            return []
        best = np.argsort(self._cost(nodes, backward), kind="stable")[: self._settings.results]
        return [_joined(kept, nodes, int(i), backward).with_ends_of(problem) for i in best]

    def _begin(self, flight: Flight, extension: Extension, backward: bool) -> _Nodes:
        base, problem = flight.itinerary, self._problem
        if backward:
            burn = (flight.mass[0] - flight.mass[-1]) / len(base)
            body = extension.first
            more = extension.before - body + (self._start is not None)
            mass = flight.mass[body] - more * burn
            departure = base.t_dep_mjd2000[body] if body < len(base) else base.t_arr_mjd2000[-1]
            clock = departure - problem.min_stay_days
        else:
            body = extension.last
            mass = flight.mass[body]
            arrival = base.t_arr_mjd2000[body - 1] if body else base.t_dep_mjd2000[0]
            clock = arrival + problem.min_stay_days if body else arrival
        nothing = np.zeros((1, 0))
        lightest = 0.5 * problem.spacecraft.m_dry
        return _Nodes(
            base.rows[body : body + 1, None],
            nothing,
            nothing,
            np.array([clock]),
            np.array([max(float(mass), lightest)]),
        )

    def _extend(self, nodes: _Nodes, avoid: _Index, backward: bool, is_start: bool) -> _Nodes:
        """Add one body and keep the best."""
        problem, settings = self._problem, self._settings
        count = min(settings.neighbours, len(problem.catalogue) - 1)
        # The metric is that of the departure epoch.
        epoch = nodes.clock - settings.reference_tof_days if backward else nodes.clock
        near = self._neighbours.query(nodes.rows[:, -1], epoch, count)
        fresh = ~np.isin(near, avoid) & ~(near[:, :, None] == nodes.rows[:, None, :]).any(axis=2)
        if is_start and problem.start_ids:
            fresh &= np.isin(near, problem.start_rows())
        parent, place = np.nonzero(fresh)
        if not len(parent):
            return nodes.take(np.zeros(0, dtype=np.intp))
        target = near[parent, place].astype(np.intp)
        tofs = np.asarray(settings.tofs_days)
        price = self._lambert_price(nodes, parent, target, tofs, backward, is_start)
        best = np.argmin(price, axis=1)
        cheapest = price[np.arange(len(price)), best]
        order = np.lexsort((cheapest, parent))
        rank = np.arange(len(order)) - np.searchsorted(parent[order], parent[order])
        chosen = order[(rank < settings.predicted) & np.isfinite(cheapest[order])]
        parent, target, best = parent[chosen], target[chosen], best[chosen]
        # The boundary is near the flight time that is cheapest by Lambert, rather above it.
        window = np.clip(best[:, None] + np.arange(-2, 4), 0, len(tofs) - 1)
        shortest = self._shortest_tof(nodes, parent, target, tofs[window], backward, is_start)
        good = np.isfinite(shortest)
        parent, target, shortest = parent[good], target[good], shortest[good]
        if not len(parent):
            return nodes.take(np.zeros(0, dtype=np.intp))
        parent, target = np.tile(parent, len(_LEISURE)), np.tile(target, len(_LEISURE))
        tof = np.concatenate([factor * shortest for factor in _LEISURE])
        legs = self._legs(nodes, parent, target, tof, backward, is_start)
        final = np.nan_to_num(self._predictor.final_mass(legs), nan=0.0)
        clock = nodes.clock[parent]
        departure = clock - tof if backward else clock
        stay = problem.min_stay_days
        burnt = legs.m0 - final
        found = _Nodes(
            np.column_stack([nodes.rows[parent], target]),
            np.column_stack([nodes.t_dep[parent], departure]),
            np.column_stack([nodes.tof[parent], tof]),
            departure - stay if backward else clock + tof + stay,
            nodes.mass[parent] + burnt if backward else final,
        )
        return found.take(_diverse(self._cost(found, backward), target, settings.width))

    def _tied(self, nodes: _Nodes, row: int, backward: bool) -> _Nodes:
        """Return n nodes with the leg to the fixed end, or from the fixed start.

        The shortest that can be flown, or else the one that is nearest to it: retiming may
        find time for it.
        """
        n, k = len(nodes.clock), len(_TIES_DAYS)
        parent, tofs = np.repeat(np.arange(n), k), np.tile(_TIES_DAYS, n)
        target = np.full(n * k, row, dtype=np.intp)
        legs = self._legs(nodes, parent, target, tofs, backward, True)
        margin = np.nan_to_num(self._predictor.margin(legs), nan=1e-9).reshape(n, k)
        flyable = margin >= 1.0 + _MARGIN
        best = np.where(flyable.any(axis=1), flyable.argmax(axis=1), margin.argmax(axis=1))
        tof = _TIES_DAYS[best]
        legs = legs.take(np.arange(n) * k + best)
        final = np.nan_to_num(self._predictor.final_mass(legs), nan=0.0)
        departure = nodes.clock - tof if backward else nodes.clock
        burnt = legs.m0 - final
        return _Nodes(
            np.column_stack([nodes.rows, target[:n]]),
            np.column_stack([nodes.t_dep, departure]),
            np.column_stack([nodes.tof, tof]),
            departure if backward else nodes.clock + tof,
            nodes.mass + burnt if backward else final,
        )

    def _cost(self, nodes: _Nodes, backward: bool) -> _Array:
        """Return (n,) the days that the extension takes, propellant included, plus a constant."""
        sign = -1.0 if backward else 1.0
        cost: _Array = sign * (nodes.clock - self._settings.propellant_days_per_kg * nodes.mass)
        return cost

    def _lambert_price(
        self,
        nodes: _Nodes,
        parent: _Index,
        target: _Index,
        tofs: _Array,
        backward: bool,
        at_end: bool,
    ) -> _Array:
        """Return (n, k) the price in days of n targets at k flight times; inf if out of reach."""
        settings, n, k = self._settings, len(parent), len(tofs)
        legs = self._legs(
            nodes, np.repeat(parent, k), np.repeat(target, k), np.tile(tofs, n), backward, at_end
        )
        delta_v = lambert_delta_v(
            *(legs.rv_dep, legs.rv_arr, legs.tof_s),
            max_revs=0,
            vinf_dep=legs.vinf_dep,
            vinf_arr=legs.vinf_arr,
        )
        available = legs.thrust / legs.m0 * legs.tof_s
        overload = np.log(np.maximum(delta_v / available, 1.0))
        burnt = legs.m0 * -np.expm1(-np.minimum(delta_v, available) / legs.exhaust_velocity)
        price = legs.tof_days + settings.propellant_days_per_kg * burnt + _OVERLOAD_DAYS * overload
        return np.where(overload < _LARGEST_OVERLOAD, price, np.inf).reshape(n, k)

    def _shortest_tof(
        self,
        nodes: _Nodes,
        parent: _Index,
        target: _Index,
        tofs: _Array,
        backward: bool,
        at_end: bool,
    ) -> _Array:
        """Return (n,) the shortest flyable of (n, k) ascending flight times; NaN if none.

        Between two flight times the logarithm of the margin is taken as linear.
        """
        n, k = tofs.shape
        legs = self._legs(
            nodes, np.repeat(parent, k), np.repeat(target, k), tofs.ravel(), backward, at_end
        )
        margin = np.nan_to_num(self._predictor.margin(legs), nan=1e-9)
        # A leg that needs no thrust has no largest mass, and no line leads to inf.
        excess = np.log(np.clip(margin, 1e-9, 1e9)).reshape(n, k) - _MARGIN
        flyable = excess >= 0
        first = np.argmax(flyable, axis=1)
        row = np.arange(n)
        before = np.maximum(first - 1, 0)
        above, below = excess[row, first], excess[row, before]
        gap = np.where(above > below, above - below, np.inf)
        share = np.where(first > 0, -below / gap, 1.0)
        tof = tofs[row, before] + np.clip(share, 0.0, 1.0) * (tofs[row, first] - tofs[row, before])
        return np.where(flyable.any(axis=1), tof, np.nan)

    def _legs(
        self,
        nodes: _Nodes,
        parent: _Index,
        target: _Index,
        tof: _Array,
        backward: bool,
        at_end: bool,
    ) -> Legs:
        """Return the legs; `at_end` are those from where tours start, or to where they end."""
        catalogue, craft = self._problem.catalogue, self._problem.spacecraft
        at, clock, mass = nodes.rows[parent, -1], nodes.clock[parent], nodes.mass[parent]
        dep, arr, departure = (target, at, clock - tof) if backward else (at, target, clock)
        if backward:
            flow = craft.thrust / craft.exhaust_velocity
            mass = mass + _THRUST_SHARE * flow * tof * DAY_S
        return Legs(
            catalogue.states_at(dep, departure),
            catalogue.states_at(arr, departure + tof),
            tof,
            np.maximum(mass, 1.0),
            craft.thrust,
            craft.isp,
            0.0,
            vinf_dep=self._launch if at_end and backward else 0.0,
            vinf_arr=self._arrival if at_end and not backward else 0.0,
        )


def _joined(kept: Itinerary, nodes: _Nodes, i: int, backward: bool) -> Itinerary:
    """Return the kept part with an extension, which backward is in reverse order of flight."""
    old = (kept.rows, kept.t_dep_mjd2000, kept.tof_days)
    new = (nodes.rows[i, 1:], nodes.t_dep[i], nodes.tof[i])
    if backward:
        pairs = [(late[::-1], early) for late, early in zip(new, old, strict=True)]
    else:
        pairs = list(zip(old, new, strict=True))
    rows, t_dep, tof = (np.concatenate(pair) for pair in pairs)
    rest = np.zeros(len(nodes.tof[i]))
    ends = [
        np.concatenate([rest, own] if backward else [own, rest])
        for own in (kept.vinf_dep, kept.vinf_arr)
    ]
    return Itinerary(rows, t_dep, tof, *ends)


def _diverse(cost: _Array, body: _Index, width: int) -> _Index:
    """Return the positions of the cheapest, no body more often than `_MAX_PER_BODY`."""
    taken: list[int] = []
    count: dict[int, int] = {}
    for i in np.argsort(cost, kind="stable"):
        if not np.isfinite(cost[i]) or count.get(int(body[i]), 0) >= _MAX_PER_BODY:
            continue
        count[int(body[i])] = count.get(int(body[i]), 0) + 1
        taken.append(int(i))
        if len(taken) == width:
            break
    return np.asarray(taken, dtype=np.intp)
