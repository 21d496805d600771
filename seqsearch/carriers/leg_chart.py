"""`LegChart`: what a classifier says of all legs between near bodies, at all epochs.

m* does not depend on the mass at departure. So the curve of m* over the flight time, for a pair of
bodies and a departure, serves spacecraft of any mass, and beams that look everything up are
hundreds of times as fast as those that ask the classifier. What is stored is what
`seqsearch.chart.curves` describes.
"""

from dataclasses import dataclass
from typing import Final, Self, final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from feasibility import Legs
from feasibility.classifier.predictor import LegPredictor
from feasibility.legs import Spacecraft
from feasibility.orbits import Catalogue
from feasibility.orbits.lambert import lambert_delta_v
from feasibility.orbits.neighbours import orbital_metric
from seqsearch.chart.curves import MAX_CODE, N_EPOCHS, SPEED_UNIT, inverse_unit
from seqsearch.core.hop_margins import quick_margin_of

_Array = NDArray[np.float64]
_Codes = NDArray[np.uint16]
_Rows = NDArray[np.int32]
_Index = NDArray[np.intp]

TOF_DAYS: Final = np.array([70.0, 100.0, 140.0, 185.0, 240.0])
HOME_TOF_DAYS: Final = np.array([50.0, 80.0, 120.0, 180.0, 270.0, 400.0])
"""Flight times of the curves: of all legs, and of those to the end."""

STEP_DAYS: Final = 80.0
"""Length of the intervals of departures."""

_NEIGHBOURS: Final = 16
_METRIC_DAYS: Final = 150.0
_FARTHEST: Final = 3500.0
"""Neighbours that are asked about: how many, in which metric, and m/s of it."""

_ASKED: Final = 3
_HEAVY_ENOUGH: Final = 1.2
"""A pair is on the chart if m* is that many dry masses at one of the flight times."""

_HOME_METRIC_DAYS: Final = 180.0
_HOME_FARTHEST: Final = 5500.0
_HOME_MOST: Final = 120
"""Bodies from which there may be a way to an end."""

_HOME_ASKED: Final = 4
_HOME_HEAVY_ENOUGH: Final = 1.05
"""There is one if m* is that many dry masses at one of the flight times."""

_MOST_ASKED: Final = 6000
"""Intervals of ends that are remembered, of some kilobytes each."""


@final
@dataclass(frozen=True, eq=False)
class Ways:
    """Legs to one body.

    With k intervals, n bodies of the chart, h curves and q flight times.

    Attributes
    ----------
    end : int
        The body, as a position in the chart.
    first : int
        The first interval.
    index : (k, n) int32
        Which curve a body has in an interval; -1 for none.
    inverse, speed : (h, 3, q) uint16
        As those of `LegChart`.
    log_tof : (q,) float64
        Logarithms of the flight times in days.
    """

    end: int
    first: int
    index: _Rows
    inverse: _Codes
    speed: _Codes
    log_tof: _Array


@final
@dataclass(frozen=True, eq=False)
class LegChart:
    """Legs between n bodies.

    With k intervals of departures, p pairs and q flight times.

    Attributes
    ----------
    rows : (n,) intp
        Catalogue rows, ascending.
    t0_mjd2000 : float
        Where the first interval begins; each is `STEP_DAYS` long.
    offsets : (k n + 1,) int64
        Pairs of body i in interval j are those from entry j n + i on.
    target : (p,) int32
        Where they lead, as positions in `rows`.
    inverse, speed : (p, 3, q) uint16
        1/m* and the velocity changes of Lambert arcs, at the beginning, the middle and the end of
        the interval and at `TOF_DAYS`, in units of `inverse_unit` and `SPEED_UNIT`.
    points : (k + 1, n, 6) float32, m/s
        The orbital metric at the ends of all intervals.
    source : (p,) int32
        From which entry of `offsets` a pair comes.
    to : (p,) int32
        Pairs in the order of their targets.
    to_offsets : (n + 1,) int64
        Pairs to body i are those from entry i of `to` on.
    """

    rows: _Index
    t0_mjd2000: float
    offsets: NDArray[np.int64]
    target: _Rows
    inverse: _Codes
    speed: _Codes
    points: NDArray[np.float32]
    source: _Rows
    to: _Rows
    to_offsets: NDArray[np.int64]

    @classmethod
    def of_parts(cls, rows: _Index, t0_mjd2000: float, parts: "list[ChartPart]") -> Self:
        """Return the chart of all intervals, in order; the last one adds its points alone."""
        inner = parts[:-1]
        counts = np.concatenate([part.counts for part in inner])
        target = np.concatenate([part.target for part in inner])
        to = np.argsort(target, kind="stable").astype(np.int32)
        return cls(
            rows=rows,
            t0_mjd2000=t0_mjd2000,
            offsets=np.concatenate([[0], np.cumsum(counts)]),
            target=target,
            inverse=np.concatenate([part.inverse for part in inner]),
            speed=np.concatenate([part.speed for part in inner]),
            points=np.array([part.points for part in parts]),
            source=np.repeat(np.arange(len(counts), dtype=np.int32), counts),
            to=to,
            to_offsets=np.searchsorted(target[to], np.arange(len(rows) + 1)),
        )

    @property
    def intervals(self) -> int:
        """How many intervals of departures there are."""
        return len(self.points) - 1

    def interval(self, t_mjd2000: float) -> int:
        """Return in which interval an epoch lies, the first or last one if in none."""
        k = int((t_mjd2000 - self.t0_mjd2000) // STEP_DAYS)
        return min(max(k, 0), self.intervals - 1)

    def positions(self, rows: _Index) -> _Index:
        """Return positions of catalogue rows; those that are not on the chart are left out."""
        at = np.minimum(np.searchsorted(self.rows, rows), len(self.rows) - 1)
        found: _Index = at[self.rows[at] == rows]
        return found

    def ways(self, end: int, first: int, last: int) -> Ways:
        """Return the legs to a body in intervals from `first` up to `last`."""
        n = len(self.rows)
        pairs = self.to[self.to_offsets[end] : self.to_offsets[end + 1]]
        interval, body = np.divmod(self.source[pairs], n)
        inside = (interval >= first) & (interval <= last)
        pairs = pairs[inside]
        index = np.full((last - first + 1, n), -1, dtype=np.int32)
        index[interval[inside] - first, body[inside]] = np.arange(len(pairs))
        curves = np.asarray(self.inverse[pairs]), np.asarray(self.speed[pairs])
        return Ways(end, first, index, *curves, np.log(TOF_DAYS))


@final
@dataclass(frozen=True, eq=False)
class ChartPart:
    """One interval of a chart; see there."""

    counts: NDArray[np.int64]
    target: _Rows
    inverse: _Codes
    speed: _Codes
    points: NDArray[np.float32]


@final
class ChartMaker:
    """Asks a predictor about all legs of a chart.

    Parameters
    ----------
    catalogue : Catalogue
        All bodies.
    rows : (n,) intp
        Those of the chart, ascending.
    spacecraft : Spacecraft
        Its engine counts.
    m0 : float, kg
        Its first mass.
    predictor : LegPredictor
        Is asked; a `QuickPredictor` for quick answers.
    t0_mjd2000 : float
        Where the first interval begins.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        rows: _Index,
        spacecraft: Spacecraft,
        m0: float,
        predictor: LegPredictor,
        t0_mjd2000: float,
    ) -> None:
        self._catalogue, self._rows, self._craft = catalogue, rows, spacecraft
        self._ask = quick_margin_of(predictor)
        self._t0 = t0_mjd2000
        self._unit = inverse_unit(spacecraft.m_dry)
        # Margins are best known for masses that legs have.
        self._mass = float(np.sqrt(m0 * spacecraft.m_dry))
        self._asked: dict[tuple[int, int], tuple[_Index, _Codes, _Codes]] = {}
        self._home_points: dict[int, NDArray[np.float32]] = {}

    def part(self, k: int) -> ChartPart:
        """Return an interval."""
        begin = self._t0 + k * STEP_DAYS
        middle = self._points(begin + 0.5 * STEP_DAYS, _METRIC_DAYS)
        count = min(_NEIGHBOURS + 1, len(middle))
        distance, near = cKDTree(middle).query(middle, count, distance_upper_bound=_FARTHEST)
        source, column = np.nonzero(np.isfinite(distance))
        target = near[source, column]
        different = source != target
        source, target = source[different], target[different]
        codes, _ = self._codes(source, target, begin + 0.5 * STEP_DAYS, TOF_DAYS[_ASKED])
        enough = codes <= 1.0 / (_HEAVY_ENOUGH * self._craft.m_dry * self._unit)
        source, target = source[enough], target[enough]
        curves = self._curves(source, target, begin, TOF_DAYS)
        counts = np.bincount(source, minlength=len(middle)).astype(np.int64)
        points = self._points(begin, _METRIC_DAYS).astype(np.float32)
        return ChartPart(counts, target.astype(np.int32), *curves, points)

    def ways(self, end: int, first: int, last: int) -> Ways:
        """Return the legs to a body in intervals from `first` up to `last`, also long ones.

        What was asked once is kept.
        """
        wanted = range(first, last + 1)
        missing = [k for k in wanted if (end, k) not in self._asked]
        if len(self._asked) + len(missing) > _MOST_ASKED:
            self._asked.clear()
            missing = list(wanted)
        if missing:
            self._ask_ways(end, np.array(missing))
        index = np.full((len(wanted), len(self._rows)), -1, dtype=np.int32)
        parts = [self._asked[end, k] for k in wanted]
        count = 0
        for k, (bodies, _, _) in enumerate(parts):
            index[k, bodies] = np.arange(count, count + len(bodies))
            count += len(bodies)
        inverse, speed = (np.concatenate([part[i] for part in parts]) for i in (1, 2))
        return Ways(end, first, index, inverse, speed, np.log(HOME_TOF_DAYS))

    def _ask_ways(self, end: int, intervals: _Index) -> None:
        """Ask about the legs to a body from those that are near it, and keep the answers."""
        near = [self._near(end, int(k)) for k in intervals]
        source, interval = np.concatenate(near), np.repeat(intervals, list(map(len, near)))
        middle: _Array = np.asarray(self._t0 + (interval + 0.5) * STEP_DAYS, dtype=np.float64)
        goal, tof = np.full(len(source), end), float(HOME_TOF_DAYS[_HOME_ASKED])
        codes, _ = self._codes(source, goal, middle, tof)
        enough = codes <= 1.0 / (_HOME_HEAVY_ENOUGH * self._craft.m_dry * self._unit)
        source, interval = source[enough], interval[enough]
        # Departures that two intervals share are asked about once.
        halves = (N_EPOCHS - 1) * interval[:, None] + np.arange(N_EPOCHS)
        keys, where = np.unique(halves * len(self._rows) + source[:, None], return_inverse=True)
        half, source_of = np.divmod(keys, len(self._rows))
        departure = self._t0 + half / (N_EPOCHS - 1) * STEP_DAYS
        goal = np.full(len(keys), end)
        asked = [self._codes(source_of, goal, departure, tof) for tof in HOME_TOF_DAYS]
        place = where.reshape(halves.shape)
        inverse, speed = (np.stack([pair[i] for pair in asked], axis=-1)[place] for i in (0, 1))
        for k in intervals:
            rows = interval == k
            self._asked[end, int(k)] = source[rows], inverse[rows], speed[rows]

    def _near(self, end: int, k: int) -> _Index:
        """Return the bodies from which there may be a way to one in an interval."""
        if k not in self._home_points:
            middle = self._t0 + (k + 0.5) * STEP_DAYS
            self._home_points[k] = self._points(middle, _HOME_METRIC_DAYS).astype(np.float32)
        points = self._home_points[k]
        distance = np.linalg.norm(points - points[end], axis=1)
        near = np.argpartition(distance, min(_HOME_MOST, len(points) - 1))[: _HOME_MOST + 1]
        return np.sort(near[(distance[near] < _HOME_FARTHEST) & (near != end)])

    def _points(self, t_mjd2000: float, days: float) -> _Array:
        return orbital_metric(self._catalogue.states_at(self._rows, t_mjd2000), days)

    def _curves(
        self, source: _Index, target: _Index, begin: _Array | float, tof_days: _Array
    ) -> tuple[_Codes, _Codes]:
        """Return two (p, 3, q) curves of an interval."""
        inverse = np.empty((len(source), N_EPOCHS, len(tof_days)), dtype=np.uint16)
        speed = np.empty_like(inverse)
        for k in range(N_EPOCHS):
            departure = begin + k / (N_EPOCHS - 1) * STEP_DAYS
            for q, tof in enumerate(tof_days):
                inverse[:, k, q], speed[:, k, q] = self._codes(source, target, departure, tof)
        return inverse, speed

    def _codes(
        self, source: _Index, target: _Index, t_dep: _Array | float, tof: float
    ) -> tuple[_Codes, _Codes]:
        """Return 1/m* and velocity changes of Lambert arcs as codes."""
        rows, craft = self._rows, self._craft
        legs = Legs(
            rv_dep=self._catalogue.states_at(rows[source], t_dep),
            rv_arr=self._catalogue.states_at(rows[target], t_dep + tof),
            tof_days=tof,
            m0=self._mass,
            thrust=craft.thrust,
            isp=craft.isp,
            m_dry=craft.m_dry,
        )
        # A leg of which nothing is known counts as one that cannot be flown.
        m_star = self._mass * np.maximum(np.nan_to_num(self._ask(legs)), 1e-9)
        speed = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s, 0)
        codes = _coded(1.0 / (m_star * self._unit))
        return codes, _coded(np.nan_to_num(speed, nan=1e9) / SPEED_UNIT)


def _coded(values: _Array) -> _Codes:
    return np.clip(np.rint(values), 0, MAX_CODE).astype(np.uint16)
