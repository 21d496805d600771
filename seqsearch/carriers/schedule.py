"""`Schedule`: what a mother ship does and when, as a vector of numbers that can be optimised.

The order of impulses, releases and captures is fixed; epochs and impulses are free. Many variants
are flown at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S, MU_SUN
from feasibility.orbits import Catalogue
from feasibility.orbits.lambert import lambert
from seqsearch.carriers.course import Course
from seqsearch.carriers.routes import Route
from seqsearch.tours.carrier.path import coasted, mass_after
from seqsearch.tours.carrier.records import CarrierImpulse, CarrierRules

_Array = NDArray[np.float64]

_REVOLUTIONS: Final = 2

IMPULSE_SCALE: Final = 100.0
"""m/s of an impulse's component that count as one."""

EPOCH_SCALE: Final = 10.0
"""Days that count as one."""

_ROUNDING: Final = 0.3
"""m/s that the smallest impulse is taken to have, so that its size is a smooth function of it."""


class Act(Enum):
    """What happens. The way to the next orbit is from DEPART to ARRIVE, by a Lambert arc."""

    IMPULSE = auto()
    DEPART = auto()
    ARRIVE = auto()
    RELEASE = auto()
    CAPTURE = auto()


@final
@dataclass(frozen=True)
class Step:
    """One of the things that happen.

    Attributes
    ----------
    act : Act
        What.
    t_mjd2000 : float
        When, at first.
    probe : int
        Which is released or caught, from 0; -1 for none.
    free : bool
        Whether the epoch may change.
    stays : bool
        Whether the probe is at an asteroid then: it has no leg from or to the mother ship.
    range_mjd2000 : tuple of float
        Earliest and latest epoch.
    dv_m_s : tuple of float
        An `IMPULSE`, at first.
    """

    act: Act
    t_mjd2000: float
    probe: int = -1
    free: bool = True
    stays: bool = False
    range_mjd2000: tuple[float, float] = (-np.inf, np.inf)
    dv_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)


@final
@dataclass(frozen=True, eq=False)
class Outing:
    """m variants of a schedule with n steps, flown.

    Attributes
    ----------
    t : (m, n) float64
        MJD2000 of all steps.
    states : (m, n, 6) float64
        Just after each, in m and m/s.
    dv : (m, n, 3) float64, m/s
        Impulses; zero where there is none.
    left_kg : (m,) float64
        What is left of her propellant.
    """

    t: _Array
    states: _Array
    dv: _Array
    left_kg: _Array


@final
class Schedule:
    """Steps of a mother ship from her first orbit on, of which the order is fixed.

    Parameters
    ----------
    steps : sequence of Step
        In order; one `DEPART` for each orbit after the first, and an `ARRIVE` right after it.
    catalogue : Catalogue
        The asteroids.
    orbits : tuple of int
        Rows of those of her orbits.
    rules : CarrierRules
        The mother ship.
    route : Route
        To the first orbit.
    stays : tuple
        The probes that stay at the asteroids of the orbits; None for none.
    caught_kg : sequence of float
        Mass of each probe when it comes back.
    """

    def __init__(
        self,
        steps: Sequence[Step],
        catalogue: Catalogue,
        orbits: tuple[int, ...],
        rules: CarrierRules,
        route: Route,
        stays: tuple[int | None, ...],
        caught_kg: Sequence[float],
    ) -> None:
        self.steps = tuple(steps)
        self._catalogue, self._orbits = catalogue, orbits
        self._rules = rules
        self._route = route
        self._mass_kg = mass_after(rules, rules.m0_kg, route.delta_v)
        self._stays = stays
        self._caught_kg = tuple(caught_kg)
        self._t_base = np.array([step.t_mjd2000 for step in steps])
        self._timed = np.flatnonzero([step.free for step in steps])
        self._aimed = np.flatnonzero([step.act is Act.IMPULSE for step in steps])

    def start(self) -> _Array:
        """Return the (k,) numbers that give the steps as they are: epochs, then impulses."""
        impulses = np.array([self.steps[k].dv_m_s for k in self._aimed]).ravel()
        return np.concatenate([np.zeros(len(self._timed)), impulses / IMPULSE_SCALE])

    def epochs(self, x: _Array) -> _Array:
        """Return the (m, n) epochs of (m, k) variants."""
        t = np.tile(self._t_base, (len(x), 1))
        t[:, self._timed] += EPOCH_SCALE * x[:, : len(self._timed)]
        return t

    def bounds(
        self, hers_days: float, probes_days: float, impulse_m_s: float
    ) -> list[tuple[float, float]]:
        """Return the ranges of all numbers, by how far epochs of hers and the probes' may move."""
        epochs = []
        for k in self._timed:
            step = self.steps[k]
            days = probes_days if step.probe >= 0 and not step.stays else hers_days
            earliest, latest = np.array(step.range_mjd2000) - step.t_mjd2000
            low, high = max(-days, earliest), min(days, latest)
            epochs.append((float(low) / EPOCH_SCALE, float(high) / EPOCH_SCALE))
        largest = impulse_m_s / IMPULSE_SCALE
        return [*epochs, *[(-largest, largest)] * (3 * len(self._aimed))]

    def fly(self, x: _Array) -> Outing:
        """Fly (m, k) variants; NaN where there is no way to the next orbit."""
        m, n = len(x), len(self.steps)
        t = self.epochs(x)
        states, dv = np.empty((m, n, 6)), np.zeros((m, n, 3))
        impulses = IMPULSE_SCALE * x[:, len(self._timed) :].reshape(m, -1, 3)
        dv[:, self._aimed] = impulses
        before = self._catalogue.states_at(np.full(m, self._orbits[0]), t[:, 0])
        reached = 0
        for k, step in enumerate(self.steps):
            if k > 0:
                before = coasted(states[:, k - 1], t[:, k] - t[:, k - 1], MU_SUN)
            after = before.copy()
            if step.act is Act.DEPART:
                reached += 1
                goal = self._catalogue.states_at(np.full(m, self._orbits[reached]), t[:, k + 1])
                dv[:, k], dv[:, k + 1] = _arc(before, goal, t[:, k + 1] - t[:, k])
            if step.act is Act.ARRIVE:
                after = goal
            else:
                after[:, 3:] += dv[:, k]
            states[:, k] = after
        return Outing(t, states, dv, self._left_kg(dv))

    def _left_kg(self, dv: _Array) -> _Array:
        rules = self._rules
        exhaust = rules.isp_s * rules.g0_m_s2
        mass = np.full(len(dv), self._mass_kg)
        for k, step in enumerate(self.steps):
            if step.act is Act.RELEASE:
                mass -= rules.craft.m0_kg
            elif step.act is Act.CAPTURE:
                mass += self._caught_kg[step.probe]
            else:
                size = np.sqrt((dv[:, k] ** 2).sum(axis=1) + _ROUNDING**2)
                mass *= np.exp(-size / exhaust)
        return mass - sum(self._caught_kg) - rules.m_dry_kg

    def course(self, x: _Array) -> Course:
        """Return the course of one variant, (k,)."""
        outing = self.fly(x[None])
        impulses: list[CarrierImpulse] = []
        settled: list[int] = []
        starts, ends = dict[int, int](), dict[int, int]()
        stay_epochs = [0.0] * len(self._orbits)
        for k, step in enumerate(self.steps):
            if step.act is Act.RELEASE:
                starts[step.probe] = len(impulses)
            elif step.act is Act.CAPTURE:
                ends[step.probe] = len(impulses)
            else:
                one, two, three = map(float, outing.dv[0, k])
                epoch = float(outing.t[0, k])
                impulses.append(CarrierImpulse(t_mjd2000=epoch, dv_m_s=(one, two, three)))
            if step.act is Act.ARRIVE:
                settled.append(len(impulses))
            if step.stays:
                orbit = len(settled) if step.act is Act.CAPTURE else 0
                stay_epochs[orbit] = float(outing.t[0, k])
        return Course(
            impulses=tuple(impulses),
            settled=tuple(settled),
            starts=tuple(starts[number] for number in sorted(starts)),
            ends=tuple(ends[number] for number in sorted(ends)),
            stays=self._stays,
            route=self._route,
            stay_epochs=tuple(stay_epochs),
        )


def _arc(here: _Array, goal: _Array, days: _Array) -> tuple[_Array, _Array]:
    """Return the (m, 3) impulses of the cheapest Lambert arcs; NaN for none."""
    tof_s = np.maximum(days, 1.0) * DAY_S
    v1, v2 = lambert(here[:, :3], goal[:, :3], tof_s, _REVOLUTIONS)
    leave, arrive = v1 - here[:, None, 3:], goal[:, None, 3:] - v2
    cost = np.linalg.norm(leave, axis=2) + np.linalg.norm(arrive, axis=2)
    best = np.argmin(np.where(np.isfinite(cost), cost, np.inf), axis=1)
    rows = np.arange(len(here))
    return leave[rows, best], arrive[rows, best]
