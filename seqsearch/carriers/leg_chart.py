"""`LegChart`: what the classifier says of all legs between near bodies, at all epochs.

m* does not depend on the mass at departure. So the curve of log(m*) over the flight time, for a
pair of bodies and a departure, serves spacecraft of any mass, and beams that look everything up are
hundreds of times as fast as those that ask the classifier.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from feasibility import Legs
from feasibility.classifier.predictor import LegPredictor, QuickPredictor
from feasibility.constants import DAY_S
from feasibility.orbits import Catalogue
from feasibility.orbits.lambert import lambert_delta_v
from feasibility.orbits.neighbours import orbital_metric
from feasibility.legs import Spacecraft

_Array = NDArray[np.float64]
_Floats = NDArray[np.float32]
_Rows = NDArray[np.int32]

TOF_DAYS: Final = np.array([70.0, 100.0, 140.0, 185.0, 240.0])
HOME_TOF_DAYS: Final = np.array([50.0, 80.0, 120.0, 180.0, 270.0, 400.0])
"""Flight times between which curves are linear."""

STEP_DAYS: Final = 80.0
_ASKED: Final = 3
"""Position of the flight time that is asked about first."""

_NEIGHBOURS: Final = 24
_METRIC_DAYS: Final = 150.0
_FARTHEST: Final = 4500.0
"""m/s of the metric."""

_HOME_FARTHEST: Final = 6500.0
_HOME_MOST: Final = 200


@final
@dataclass(frozen=True, eq=False)
class LegChart:
    """Legs between n bodies.

    With k intervals of departure epochs, p pairs and q flight times.

    Attributes
    ----------
    rows : (n,) intp
        Catalogue rows.
    t0_mjd2000 : float
        Where the first interval begins; each is `STEP_DAYS` long.
    offsets : (k n + 1,) int64
        Pairs of body i in interval j are those from entry j n + i on.
    target : (p,) int32
        Where they lead, as positions in `rows`.
    log_m_star : (p, 2, q) float32
        log(m*/kg) at both ends of the interval.
    delta_v : (p, 2, q) float32, m/s
        Of Lambert arcs.
    points : (k + 1, n, 6) float32, m/s
        The orbital metric at the ends of all intervals.
    """

    rows: NDArray[np.intp]
    t0_mjd2000: float
    offsets: NDArray[np.int64]
    target: _Rows
    log_m_star: _Floats
    delta_v: _Floats
    points: _Floats

    @property
    def intervals(self) -> int:
        """How many intervals of departure epochs there are."""
        return len(self.points) - 1


@final
class ChartMaker:
    """Makes charts.

    Parameters
    ----------
    catalogue : Catalogue
        All bodies.
    rows : (n,) intp
        Those of the chart.
    spacecraft : Spacecraft
        Its engine counts, and its masses roughly.
    predictor : LegPredictor
        Asked for margins.
    t0_mjd2000 : float
        Where the first interval begins.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        rows: NDArray[np.intp],
        spacecraft: Spacecraft,
        predictor: LegPredictor,
        t0_mjd2000: float,
        m0: float,
    ) -> None:
        self._catalogue, self._rows = catalogue, rows
        self._craft, self._predictor = spacecraft, predictor
        self._t0 = t0_mjd2000
        self._mass = float(np.sqrt(m0 * spacecraft.m_dry))

    def points(self, k: int) -> _Floats:
        """Return (n, 6) the metric at the beginning of an interval."""
        states = self._catalogue.states_at(self._rows, self._t0 + k * STEP_DAYS)
        return orbital_metric(states, _METRIC_DAYS).astype(np.float32)

    def interval(self, k: int) -> tuple[NDArray[np.int64], _Rows, _Floats, _Floats]:
        """Return how many pairs each body has in an interval, where they lead, and both curves."""
        begin = self._t0 + k * STEP_DAYS
        middle = self._catalogue.states_at(self._rows, begin + 0.5 * STEP_DAYS)
        points = orbital_metric(middle, _METRIC_DAYS)
        n = len(points)
        distance, near = cKDTree(points).query(points, k=_NEIGHBOURS + 1, distance_upper_bound=_FARTHEST)
        source, column = np.nonzero(np.isfinite(distance))
        target = near[source, column]
        different = source != target
        source, target = source[different], target[different]
        within = np.log(self._craft.m_dry)
        asked, _ = self._ask(source, target, begin + 0.5 * STEP_DAYS, float(TOF_DAYS[_ASKED]))
        good = asked >= within
        source, target = source[good], target[good]
        values = [
            [self._ask(source, target, epoch, float(tof)) for tof in TOF_DAYS]
            for epoch in (begin, begin + STEP_DAYS)
        ]
        table = np.array(values, dtype=np.float32)  # (2, q, 2, p)
        counts = np.bincount(source, minlength=n).astype(np.int64)
        curves = table.transpose(2, 3, 0, 1)
        return counts, target.astype(np.int32), curves[0].copy(), curves[1].copy()

    def home(
        self, end: int, first: int, last: int
    ) -> tuple[NDArray[np.int32], _Floats, _Floats]:
        """Return the legs to one body.

        Parameters
        ----------
        end : int
            Position in the chart's bodies.
        first, last : int
            Intervals, the last one excluded.

        Returns
        -------
        index : (last - first, n) int32
            Which curve a body has; -1 for none.
        log_m_star, delta_v : (h, 2, q) float32
            The curves, over `HOME_TOF_DAYS`.
        """
        n = len(self._rows)
        index = np.full((last - first, n), -1, dtype=np.int32)
        sources, epochs = [], []
        count = 0
        for k in range(first, last):
            begin = self._t0 + k * STEP_DAYS
            points = orbital_metric(self._catalogue.states_at(self._rows, begin + 0.5 * STEP_DAYS), 180.0)
            distance = np.linalg.norm(points - points[end], axis=1)
            near = np.argsort(distance, kind="stable")[1 : _HOME_MOST + 1]
            near = near[distance[near] < _HOME_FARTHEST]
            index[k - first, near] = np.arange(count, count + len(near))
            count += len(near)
            sources.append(near)
            epochs.append(np.full(len(near), begin))
        source, epoch = np.concatenate(sources), np.concatenate(epochs)
        target = np.full(len(source), end)
        values = [
            [self._ask(source, target, at, float(tof)) for tof in HOME_TOF_DAYS]
            for at in (epoch, epoch + STEP_DAYS)
        ]
        table = np.array(values, dtype=np.float32).transpose(2, 3, 0, 1)
        return index, table[0].copy(), table[1].copy()

    def _ask(
        self, source: NDArray[np.intp], target: NDArray[np.intp], t_dep: _Array | float, tof: float
    ) -> tuple[_Array, _Array]:
        """Return log(m*), and the velocity changes of Lambert arcs."""
        rows, craft = self._rows, self._craft
        legs = Legs(
            rv_dep=self._catalogue.states_at(rows[source], t_dep),
            rv_arr=self._catalogue.states_at(rows[target], np.asarray(t_dep) + tof),
            tof_days=tof,
            m0=self._mass,
            thrust=craft.thrust,
            isp=craft.isp,
            m_dry=craft.m_dry,
        )
        quick = isinstance(self._predictor, QuickPredictor)
        margin = self._predictor.quick_margin(legs) if quick else self._predictor.margin(legs)
        delta_v = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s, 0)
        return np.log(self._mass * margin), delta_v
