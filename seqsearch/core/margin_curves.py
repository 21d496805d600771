"""`MarginCurves`: how the margin from a node to a target grows with the flight time."""

from dataclasses import dataclass, replace
from typing import Final, Self, final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

_Array = NDArray[np.float64]

_BISECTIONS: Final = 24
"""Halvings of an interval of flight times: to a millionth of its width."""


@final
@dataclass(frozen=True, eq=False)
class MarginCurves:
    """log(m*/m0) against the flight time, a cubic spline for each of n pairs.

    A pair is a node and a target at one departure epoch. The spline's abscissa
    is log(flight time), scaled to 0 to 1 between a pair's shortest and longest
    time, so that all pairs share their knots.

    Attributes
    ----------
    log_first, log_last : (n,) float64
        Logarithms of the shortest and longest flight time in days.
    knots : (g,) float64
        Abscissae, 0 to 1.
    coefficients : (4, g - 1, n) float64
        Of each interval's cubic, highest power first, as scipy has them.
    values : (g, n) float64
        At the knots.
    correction : (n,) float64
        What is added to the spline: the error of cheap answers hardly depends
        on the flight time, so that one better answer corrects a whole curve.
    """

    log_first: _Array
    log_last: _Array
    knots: _Array
    coefficients: _Array
    values: _Array
    correction: _Array

    def __len__(self) -> int:
        return len(self.log_first)

    @classmethod
    def through(cls, first_days: _Array, last_days: _Array, values: _Array) -> Self:
        """Return the curves through values at evenly spaced logarithms of the flight time.

        Parameters
        ----------
        first_days, last_days : (n,) float64
            Shortest and longest flight times, see `flight_times`.
        values : (n, g) float64
            log(m*/m0) at the g flight times, at least two, none of them NaN.
        """
        knots = np.linspace(0.0, 1.0, values.shape[1])
        at_knots = np.ascontiguousarray(values.T)
        spline = CubicSpline(knots, at_knots)
        return cls(
            log_first=np.log(first_days),
            log_last=np.log(last_days),
            knots=knots,
            coefficients=spline.c,
            values=at_knots,
            correction=np.zeros(len(first_days)),
        )

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Self:
        """Return the curves at the given rows (indices or a mask)."""
        return replace(
            self,
            log_first=self.log_first[rows],
            log_last=self.log_last[rows],
            coefficients=self.coefficients[:, :, rows],
            values=self.values[:, rows],
            correction=self.correction[rows],
        )

    @classmethod
    def concatenate(cls, parts: "list[MarginCurves]") -> Self:
        """Return the curves of all parts, at least one and with equal knots, in order."""
        return cls(
            log_first=np.concatenate([part.log_first for part in parts]),
            log_last=np.concatenate([part.log_last for part in parts]),
            knots=parts[0].knots,
            coefficients=np.concatenate([part.coefficients for part in parts], axis=2),
            values=np.concatenate([part.values for part in parts], axis=1),
            correction=np.concatenate([part.correction for part in parts]),
        )

    def corrected(self, tof_days: _Array, log_margin: _Array) -> Self:
        """Return the curves shifted so that they go through one better answer each.

        Parameters
        ----------
        tof_days : (n,) float64
            Where the better answers were asked for.
        log_margin : (n,) float64
            The answers; a curve stays as it is where it is NaN.
        """
        shift = log_margin - self.log_margin(tof_days)
        return replace(self, correction=self.correction + np.nan_to_num(shift, nan=0.0))

    def log_margin(self, tof_days: _Array) -> _Array:
        """Return (n,) log(m*/m0) at one flight time a pair, which must be within its range."""
        span = self.log_last - self.log_first
        u = np.where(
            span > 0, (np.log(tof_days) - self.log_first) / np.where(span > 0, span, 1), 0
        )
        interval = np.clip(
            np.searchsorted(self.knots, u, side="right") - 1, 0, len(self.knots) - 2
        )
        return self._on(interval, u - self.knots[interval]) + self.correction

    def shortest(self, level: float) -> _Array:
        """Return (n,) days, the shortest flight time at which log(m*/m0) reaches `level`.

        NaN where it does not at any knot.
        """
        n = len(self)
        wanted = level - self.correction
        reaches = self.values >= wanted
        knot = reaches.argmax(axis=0)
        found = reaches.any(axis=0)
        interval = np.maximum(knot - 1, 0)
        step = self.knots[1]
        low, high = np.zeros(n), np.full(n, step)
        high[knot == 0] = 0.0
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            enough = self._on(interval, middle) >= wanted
            high = np.where(enough, middle, high)
            low = np.where(enough, low, middle)
        u = self.knots[interval] + high
        tof = np.exp(self.log_first + u * (self.log_last - self.log_first))
        return np.where(found, tof, np.nan)

    def _on(self, interval: NDArray[np.intp], x: _Array) -> _Array:
        """Return (n,) the splines without correction, at a distance from a knot."""
        a, b, c, d = self.coefficients[:, interval, np.arange(len(self))]
        value: _Array = ((a * x + b) * x + c) * x + d
        return value


def flight_times(first_days: _Array, last_days: _Array, count: int) -> _Array:
    """Return (n, count) flight times in days, evenly spaced in their logarithms."""
    u = np.linspace(0.0, 1.0, count)
    log_first, log_last = np.log(first_days)[:, None], np.log(last_days)[:, None]
    times: _Array = np.exp(log_first + u * (log_last - log_first))
    return times
