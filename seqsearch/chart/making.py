"""`make_chart`: asks a predictor about all legs of a `CurveChart`."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from feasibility import Legs
from feasibility.classifier.predictor import LegPredictor
from feasibility.constants import DAY_S
from feasibility.orbits.lambert import lambert_delta_v
from feasibility.orbits.neighbours import orbital_metric
from feasibility.runtime.workers import in_threads
from seqsearch.chart.curves import (
    MAX_CODE,
    N_EPOCHS,
    N_TOFS,
    SPEED_UNIT,
    Codes,
    CurveChart,
    Survey,
    inverse_unit,
)
from seqsearch.core.hop_margins import Ask, quick_margin_of

_Array = NDArray[np.float64]
_Rows = NDArray[np.int32]
_Pairs = tuple[_Rows, _Rows]

_NEIGHBOURS: Final = 16
_METRIC_SHARE: Final = 0.625
_FARTHEST: Final = 0.75
"""Neighbours that are asked about: how many, in the metric for which share of the longest flight,
and how far away, as a share of what the engine can do in the time of the fourth flight."""

_ASKED: Final = 3
_HEAVY_ENOUGH: Final = 1.15
"""A pair is on the chart if m* is that many dry masses at the fourth flight time."""

_ON_CHART: Final = 0.17
"""Share of the pairs of neighbours that is, for an estimate of the work."""


def legs_of(survey: Survey) -> float:
    """Return about how many legs the predictor is asked about for a chart."""
    pairs = float(_NEIGHBOURS * len(survey.rows) * survey.intervals)
    return pairs * (1.0 + _ON_CHART * N_EPOCHS * N_TOFS)


def make_chart(
    survey: Survey,
    predictor: LegPredictor,
    *,
    threads: int = 1,
    goes_on: Callable[[], bool] = lambda: True,
) -> CurveChart | None:
    """Return a chart; None where it was given up.

    Parameters
    ----------
    survey : Survey
        What to chart.
    predictor : LegPredictor
        Is asked; a `QuickPredictor` for quick answers.
    threads : int
        How many ask.
    goes_on : callable
        Asked now and then whether to go on.
    """
    return _Maker(survey, quick_margin_of(predictor), threads, goes_on).chart()


class _GivenUpError(Exception):
    """There is no time for the rest of the chart."""


class _Maker:
    def __init__(
        self, survey: Survey, ask: Ask, threads: int, goes_on: Callable[[], bool]
    ) -> None:
        self._survey, self._ask = survey, ask
        self._threads, self._goes_on = threads, goes_on
        self._unit = inverse_unit(survey.m_dry)

    def chart(self) -> CurveChart | None:
        """Ask about departures that two intervals share once."""
        survey, n = self._survey, len(self._survey.rows)
        count, step = survey.intervals, survey.step_days
        try:
            pairs = list(in_threads(self._pairs, range(count), self._threads))
            keys = [source.astype(np.int64) * n + target for source, target in pairs]
            none = np.zeros(0, dtype=np.int64)
            at_ends = [
                np.union1d(before, after)
                for before, after in zip([none, *keys], [*keys, none], strict=True)
            ]
            asked = [
                *((key, survey.first_mjd2000 + k * step) for k, key in enumerate(at_ends)),
                *((key, survey.first_mjd2000 + (k + 0.5) * step) for k, key in enumerate(keys)),
            ]
            curves = list(in_threads(self._curves, asked, self._threads))
        except _GivenUpError:
            return None
        offsets = self._offsets(pairs)
        codes = tuple(np.empty((offsets[-1], N_EPOCHS, N_TOFS), dtype=np.uint16) for _ in range(2))
        for k, key in enumerate(keys):
            part = slice(offsets[k * n], offsets[(k + 1) * n])
            first, last = (np.searchsorted(at_ends[j], key) for j in (k, k + 1))
            for which, code in enumerate(codes):
                code[part, 0] = curves[k][which][first]
                code[part, 1] = curves[count + 1 + k][which]
                code[part, 2] = curves[k + 1][which][last]
        return CurveChart(
            rows=survey.rows,
            t0_mjd2000=survey.first_mjd2000,
            step_days=step,
            tof_days=survey.tof_days,
            inverse_unit=self._unit,
            offsets=offsets,
            target=np.concatenate([target for _, target in pairs]),
            inverse=codes[0],
            speed=codes[1],
        )

    def _offsets(self, pairs: list[_Pairs]) -> NDArray[np.int64]:
        n = len(self._survey.rows)
        counts = np.concatenate([np.bincount(source, minlength=n) for source, _ in pairs])
        return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)

    def _pairs(self, k: int) -> _Pairs:
        """Return sources and targets of an interval, in order of the sources."""
        self._check()
        survey = self._survey
        epoch = survey.first_mjd2000 + (k + 0.5) * survey.step_days
        states = survey.catalogue.states_at(survey.rows, epoch)
        points = orbital_metric(states, _METRIC_SHARE * float(survey.tof_days[-1]))
        tof = float(survey.tof_days[_ASKED])
        least = _HEAVY_ENOUGH * survey.m_dry
        farthest = _FARTHEST * survey.thrust / least * tof * DAY_S
        distance, near = cKDTree(points).query(
            points, min(_NEIGHBOURS + 1, len(points)), distance_upper_bound=farthest
        )
        source, column = np.nonzero(np.isfinite(distance))
        target = near[source, column]
        different = source != target
        source, target = source[different], target[different]
        inverse, _ = self._codes(source, target, epoch, tof)
        enough = inverse <= 1.0 / (least * self._unit)
        return source[enough].astype(np.int32), target[enough].astype(np.int32)

    def _curves(self, asked: tuple[NDArray[np.int64], float]) -> tuple[Codes, Codes]:
        """Return two (p, 5) codes of pairs at a departure."""
        self._check()
        key, epoch = asked
        source, target = np.divmod(key, len(self._survey.rows))
        inverse = np.empty((len(key), N_TOFS), dtype=np.uint16)
        speed = np.empty_like(inverse)
        for q, tof in enumerate(self._survey.tof_days):
            inverse[:, q], speed[:, q] = self._codes(source, target, epoch, float(tof))
        return inverse, speed

    def _codes(
        self, source: NDArray[np.intp], target: NDArray[np.intp], epoch: float, tof: float
    ) -> tuple[Codes, Codes]:
        """Return 1/m* and velocity changes of Lambert arcs as codes."""
        survey = self._survey
        if len(source) == 0:
            return np.zeros(0, dtype=np.uint16), np.zeros(0, dtype=np.uint16)
        legs = Legs(
            rv_dep=survey.catalogue.states_at(survey.rows[source], epoch),
            rv_arr=survey.catalogue.states_at(survey.rows[target], epoch + tof),
            tof_days=tof,
            m0=survey.mass,
            thrust=survey.thrust,
            isp=survey.isp,
            m_dry=survey.m_dry,
        )
        # A leg of which nothing is known counts as one that cannot be flown.
        m_star = survey.mass * np.maximum(np.nan_to_num(self._ask(legs)), 1e-9)
        speed = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s, 0)
        return _coded(1.0 / (m_star * self._unit)), _coded(
            np.nan_to_num(speed, nan=1e9) / SPEED_UNIT
        )

    def _check(self) -> None:
        if not self._goes_on():
            raise _GivenUpError


def _coded(values: _Array) -> Codes:
    return np.clip(np.rint(values), 0, MAX_CODE).astype(np.uint16)
