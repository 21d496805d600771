"""`fly_carrier`: where a carrier is and what it weighs, by Kepler arcs and the rocket equation."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import DAY_S
from feasibility.errors import InputError
from feasibility.orbits.classical import cartesian_to_classical
from seqsearch.tours.carrier.records import (
    Carrier,
    CarrierImpulse,
    CarrierRules,
    CraftCapture,
    CraftRelease,
)
from seqsearch.tours.paths import body_states
from seqsearch.tours.records import TourBody

_Array = NDArray[np.float64]


@final
@dataclass(frozen=True, eq=False)
class CarrierPath:
    """A flown carrier, with n events.

    Attributes
    ----------
    carrier : Carrier
        The flight.
    t_mjd2000 : (n,) array
        Epochs of the events.
    before, after : (n, 6) array
        States just before and after each event, m and m/s; before the launch, the planet's.
    mass_kg : (n,) array
        Mass after each event, with the craft aboard.
    alone_kg : (n,) array
        The same without any craft.
    """

    carrier: Carrier
    t_mjd2000: _Array
    before: _Array
    after: _Array
    mass_kg: _Array
    alone_kg: _Array

    def states(self, t_mjd2000: ArrayLike) -> _Array:
        """Return (k, 6) states in m and m/s at k epochs, after the events of the same epoch.

        Raises
        ------
        InputError
            An epoch is before the launch.
        """
        epochs = np.atleast_1d(np.asarray(t_mjd2000, dtype=np.float64))
        row = np.searchsorted(self.t_mjd2000, epochs, side="right") - 1
        if (row < 0).any():
            raise InputError(
                f"epoch {epochs.min():.6f} MJD2000, expected none before the launch at "
                f"{self.t_mjd2000[0]:.6f}"
            )
        return coasted(self.after[row], epochs - self.t_mjd2000[row], self._mu)

    def orbit(self, t_mjd2000: float, *, body_id: int, name: str = "MOTHER") -> TourBody:
        """Return the orbit that the carrier follows after an epoch, as a body of a tour.

        Raises
        ------
        InputError
            The epoch is before the launch, or the orbit is no ellipse.
        """
        return self._body(self.states(t_mjd2000)[0], t_mjd2000, body_id, name)

    def release_orbit(self, craft: int, *, body_id: int, name: str = "MOTHER") -> TourBody:
        """Return the orbit at the release of a craft, without impulses that follow at once.

        Raises
        ------
        InputError
            The craft is never released, or the orbit is no ellipse.
        """
        return self._orbit_at(CraftRelease, craft, body_id, name)

    def capture_orbit(self, craft: int, *, body_id: int, name: str = "MOTHER") -> TourBody:
        """Return the orbit at the capture of a craft, without impulses that follow at once.

        Raises
        ------
        InputError
            The craft is never caught, or the orbit is no ellipse.
        """
        return self._orbit_at(CraftCapture, craft, body_id, name)

    def _orbit_at(
        self, kind: type[CraftRelease] | type[CraftCapture], craft: int, body_id: int, name: str
    ) -> TourBody:
        for k, event in enumerate(self.carrier.events):
            if isinstance(event, kind) and event.craft == craft:
                return self._body(self.after[k], event.t_mjd2000, body_id, name)
        raise InputError(f"carrier: no {kind.__name__} of craft {craft}")

    def _body(self, state: _Array, t_mjd2000: float, body_id: int, name: str) -> TourBody:
        a, e, i, node, argp, anomaly = map(float, cartesian_to_classical(state, self._mu))
        return TourBody(
            id=body_id,
            name=name,
            epoch_mjd2000=float(t_mjd2000),
            a_m=a,
            e=e,
            i_rad=i,
            node_rad=node,
            argp_rad=argp,
            mean_anomaly_rad=anomaly,
        )

    @property
    def propellant_left_kg(self) -> float:
        """What the carrier may still burn after the last event; negative if it burnt too much."""
        return float(self.alone_kg[-1]) - self.carrier.rules.m_dry_kg

    @property
    def _mu(self) -> float:
        return self.carrier.rules.mu_m3_s2


def fly_carrier(carrier: Carrier) -> CarrierPath:
    """Fly a carrier through its events.

    Parameters
    ----------
    carrier : Carrier
        What happens, and by which rules.

    Returns
    -------
    CarrierPath
        States and masses at all events.
    """
    rules = carrier.rules
    epochs = np.array([event.t_mjd2000 for event in carrier.events])
    before, after = np.empty((2, len(epochs), 6))
    mass, alone = np.empty((2, len(epochs)))
    before[0] = body_states(rules.planet, epochs[:1], rules.mu_m3_s2)[0]
    after[0] = before[0]
    after[0, 3:] += carrier.launch.v_inf_m_s
    mass[0], aboard_kg = rules.m0_kg, rules.craft_count * rules.craft.m0_kg
    alone[0] = mass[0] - aboard_kg
    for k, event in enumerate(carrier.events[1:], 1):
        days = epochs[k] - epochs[k - 1]
        before[k] = after[k] = coasted(after[k - 1 : k], np.array([days]), rules.mu_m3_s2)[0]
        mass[k] = mass[k - 1]
        match event:
            case CarrierImpulse(dv_m_s=dv):
                after[k, 3:] += dv
                mass[k] = mass_after(rules, mass[k], float(np.linalg.norm(dv)))
            case CraftRelease():
                mass[k] -= rules.craft.m0_kg
                aboard_kg -= rules.craft.m0_kg
            case CraftCapture(mass_kg=gained):
                mass[k] += gained
                aboard_kg += gained
        alone[k] = mass[k] - aboard_kg
    return CarrierPath(carrier, epochs, before, after, mass, alone)


def mass_after(rules: CarrierRules, mass_kg: float, dv_m_s: float) -> float:
    """Return the mass after an impulse, by the rocket equation."""
    return float(mass_kg * np.exp(-dv_m_s / (rules.isp_s * rules.g0_m_s2)))


def coasted(states: _Array, days: _Array, mu: float) -> _Array:
    """Return (n, 6) states after n times of coasting, from (n, 6) states; m, m/s and days."""
    # Imported here: compiled kernels take a moment to load.
    from feasibility.orbits.kepler_kernels import propagate_batch

    moved: _Array = propagate_batch(np.ascontiguousarray(states), days * DAY_S, mu)
    return moved
