"""A leg in scaled units: where throttles lead, how that changes, and what is best nearby."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.continuous.grid import daily_edges
from feasibility.continuous.leg import ContinuousLeg, Scale

_Array = NDArray[np.float64]

_FULL: Final = 1.0 - 1e-12
"""Share of the engine's thrust that is used, so that rounding never makes it more."""

_STIFF: Final = 1e14
"""Price of half the squared gap: leaves a gap of the multipliers' size times its inverse."""

_RESIDUAL: Final = 1e-13
"""Largest error of the convex problem's equations."""

_CAUTIOUS: Final = (30.0, 5.0, 1.0, 0.2)
"""Weights by which the multipliers are found where nothing is known of them."""

_LARGEST_MISS: Final = 1e-9
"""A larger miss in the model says that its equations were not solved."""

_STEP_DAYS: Final = 2.0
"""By how much one iteration may move the arrival."""

_SAME_DAYS: Final = 1e-9


@final
@dataclass(frozen=True, eq=False)
class Point:
    """Throttles of a leg and what they lead to, in scaled units; n segments.

    Attributes
    ----------
    edges_mjd2000 : (n + 1,) array
        Epochs between which the thrust is constant.
    throttles : (n, 3) array
        Throttle vectors, at most 1 long.
    nodes : (n + 1, 7) array
        States and masses at the epochs.
    gap : (6,) array
        State at the arrival less that of the target.
    thrust_time : float
        Time integral of the throttle's size, to which the propellant is proportional.
    """

    edges_mjd2000: _Array
    throttles: _Array
    nodes: _Array
    gap: _Array
    thrust_time: float

    @property
    def gap_size(self) -> float:
        """Return the norm of the gap."""
        return float(np.linalg.norm(self.gap))


@final
@dataclass(frozen=True, eq=False)
class Linearisation:
    """How the gap of a point changes.

    Attributes
    ----------
    throttles : (n, 3) array
        The throttle vectors about which it is.
    t_arr_mjd2000 : float
        The arrival.
    gap : (6,) array
        What is to be closed.
    dt : (n,) array
        Lengths of the segments.
    by_throttle : (n, 6, 3) array
        By the throttle vectors.
    by_size : (n, 6) array
        By the sizes of the throttles, through the mass.
    by_delay : (6,) array
        By a delay of the arrival, per day.
    """

    throttles: _Array
    t_arr_mjd2000: float
    gap: _Array
    dt: _Array
    by_throttle: _Array
    by_size: _Array
    by_delay: _Array


@final
@dataclass(frozen=True)
class Caution:
    """How far a step may go: weights of the squared changes of throttles and of the arrival.

    Attributes
    ----------
    throttles : float
        For a throttle's change by 1 all the time, half of this is paid.
    arrival : float
        For a change by 1 day, half of this.
    """

    throttles: float
    arrival: float


@final
@dataclass(frozen=True, eq=False)
class Step:
    """The best throttles and delay of a linearisation.

    Attributes
    ----------
    throttles : (n, 3) array
        Throttle vectors.
    delay_days : float
        Delay of the arrival.
    multipliers : (6,) array
        Those of the six equations that close the gap.
    thrust_time : float
        What the throttles cost.
    miss : float
        The gap that is left in the model.
    """

    throttles: _Array
    delay_days: float
    multipliers: _Array
    thrust_time: float
    miss: float


@final
class LegModel:
    """The equations of a leg in units of its engine and of the Sun's gravity.

    Parameters
    ----------
    leg : ContinuousLeg
        The leg.
    arrival_mjd2000 : tuple of float
        Earliest and latest arrival.
    price : float
        Price of a delay, in time at full thrust.

    Attributes
    ----------
    full_thrust_n : float
        Thrust of a throttle of size 1.
    """

    def __init__(
        self, leg: ContinuousLeg, arrival_mjd2000: tuple[float, float], price: float
    ) -> None:
        self.leg = leg
        self.scale = Scale.of(leg.mu_m3_s2)
        self.price_per_day = price / self.scale.days
        self.full_thrust_n = leg.thrust_n * _FULL
        self._window = arrival_mjd2000

    @cached_property
    def _push(self) -> float:
        unit = self.scale.length_m / self.scale.time_s**2
        return self.full_thrust_n / self.leg.m0_kg / unit

    @cached_property
    def _burn(self) -> float:
        flow = self.full_thrust_n / self.leg.exhaust_velocity_m_s
        return flow / self.leg.m0_kg * self.scale.time_s

    @cached_property
    def _departure(self) -> _Array:
        return self.scale.state(self.leg.departure)

    def point(self, edges_mjd2000: _Array, throttles: _Array) -> Point:
        """Return where throttles lead."""
        # Imported here: numba takes a while to load.
        from feasibility.continuous.arc_kernels import shoot

        dt = np.diff(edges_mjd2000) / self.scale.days
        nodes = np.empty((len(dt) + 1, 7))
        shoot(self._departure, throttles, dt, self._push, self._burn, nodes)
        gap = nodes[-1, :6] - self._target(edges_mjd2000)
        cost = float(np.linalg.norm(throttles, axis=1) @ dt)
        return Point(edges_mjd2000, throttles, nodes, gap, cost)

    def after(self, point: Point, step: Step) -> Point:
        """Return the point to which a step leads; the thrust of the last day fills a delay."""
        if abs(step.delay_days) < _SAME_DAYS:
            return self.point(point.edges_mjd2000, step.throttles)
        edges = daily_edges(
            self.leg.t_dep_mjd2000, float(point.edges_mjd2000[-1]) + step.delay_days
        )
        n = len(edges) - 1
        more = np.repeat(step.throttles[-1:], max(0, n - len(step.throttles)), axis=0)
        return self.point(edges, np.concatenate([step.throttles[:n], more]))

    def linearised(self, point: Point) -> Linearisation:
        """Return how the gap of a point changes."""
        return self._linearised(point.edges_mjd2000, point.throttles, point.nodes.copy(), True)[0]

    def joined(
        self, edges_mjd2000: _Array, throttles: _Array, states: _Array, caution: Caution
    ) -> tuple[_Array, _Array]:
        """Return throttles and states after one iteration that joins the segments of a path.

        A path of many revolutions may be near one that can be flown although its own throttles,
        flown from the departure, lead somewhere else. So each segment first begins where the path
        says ("multiple shooting").

        Parameters
        ----------
        edges_mjd2000 : (n + 1,) array
            Epochs of the segments.
        throttles : (n, 3) array
            Throttle vectors.
        states : (n + 1, 6) array
            Scaled states of the path at the epochs.
        caution : Caution
            How far to go.
        """
        from feasibility.continuous.arc_kernels import follow

        nodes = np.empty((len(throttles) + 1, 7))
        nodes[:, :6] = states
        linear, jacobian, defects = self._linearised(edges_mjd2000, throttles, nodes, False)
        step = self.best_step(linear, caution, np.zeros(6))
        sizes = np.linalg.norm(step.throttles, axis=1) - np.linalg.norm(throttles, axis=1)
        change = step.throttles - throttles
        follow(jacobian, defects, linear.dt, self._burn, change, sizes, nodes)
        return step.throttles, nodes[:, :6]

    def _linearised(
        self, edges_mjd2000: _Array, throttles: _Array, nodes: _Array, joined: bool
    ) -> tuple[Linearisation, _Array, _Array]:
        """Return the linearisation, derivatives of the segments, and where they do not meet."""
        from feasibility.continuous.arc_kernels import sensitivities, shoot_derivatives

        dt = np.diff(edges_mjd2000) / self.scale.days
        n = len(dt)
        ends, jacobian = np.empty((n, 6)), np.empty((n, 6, 11))
        by_throttle, by_size = np.empty((n, 6, 3)), np.empty((n, 6))
        nodes[0, :6] = self._departure
        shoot_derivatives(throttles, dt, self._push, self._burn, joined, nodes, ends, jacobian)
        target = self._target(edges_mjd2000)
        defects = ends - np.concatenate([nodes[1:-1, :6], target[None]])
        gap = sensitivities(jacobian, defects, dt, self._burn, by_throttle, by_size)
        drift = _motion(ends[-1]) - _motion(target)
        drift[3:] += self._push * throttles[-1] / nodes[-1, 6]
        drift /= self.scale.days
        arrival = float(edges_mjd2000[-1])
        linear = Linearisation(throttles, arrival, gap, dt, by_throttle, by_size, drift)
        return linear, jacobian, defects

    def best_step(self, linear: Linearisation, caution: Caution, multipliers: _Array) -> Step:
        """Return the best throttles of a linearisation.

        Parameters
        ----------
        linear : Linearisation
            The equations.
        caution : Caution
            How far to go.
        multipliers : (6,) array
            Those of the last iteration; zero where there was none.
        """
        step = None
        if multipliers.any():
            step = self._solved(linear, caution, multipliers)
        if step is None or step.miss > _LARGEST_MISS:
            # Without a good guess: from a problem so cautious that it is nearly quadratic.
            multipliers = np.zeros(6)
            for weight in _CAUTIOUS:
                if weight > caution.throttles:
                    cautious = Caution(weight, caution.arrival)
                    multipliers = self._solved(linear, cautious, multipliers).multipliers
            step = self._solved(linear, caution, multipliers)
        return step

    def _solved(self, linear: Linearisation, caution: Caution, multipliers: _Array) -> Step:
        from feasibility.continuous.dual_kernels import least_thrust

        sizes = np.linalg.norm(linear.throttles, axis=1)
        bound = np.einsum("kij,kj->i", linear.by_throttle, linear.throttles)
        bound += linear.by_size.T @ sizes - linear.gap
        earliest, latest = self._window
        # A delay also lengthens the thrust of the last segment.
        price = self.price_per_day + sizes[-1] / self.scale.days
        low = min(0.0, max(earliest - linear.t_arr_mjd2000, -_STEP_DAYS))
        high = max(0.0, min(latest - linear.t_arr_mjd2000, _STEP_DAYS))
        delay = np.array([price, caution.arrival, low, high, 0.0])
        throttles, multipliers = np.empty_like(linear.throttles), multipliers.copy()
        worst = least_thrust(
            multipliers,
            bound,
            linear.by_throttle,
            linear.by_size,
            linear.dt,
            linear.throttles,
            caution.throttles,
            _STIFF,
            linear.by_delay,
            delay,
            _RESIDUAL,
            throttles,
        )
        cost = float(np.linalg.norm(throttles, axis=1) @ linear.dt)
        miss = float(np.linalg.norm(multipliers)) / _STIFF + worst
        return Step(throttles, float(delay[4]), multipliers, cost, miss)

    def _target(self, edges_mjd2000: _Array) -> _Array:
        return self.scale.state(self.leg.target(float(edges_mjd2000[-1])))


def _motion(state: _Array) -> _Array:
    """Return the time derivative of a state under gravity alone."""
    place = state[:3]
    return np.concatenate([state[3:], -place / np.linalg.norm(place) ** 3])
