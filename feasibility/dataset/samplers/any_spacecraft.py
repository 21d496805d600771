"""Sampler of legs of any spacecraft between any orbits of the inner solar system and the belt."""

from typing import Annotated, ClassVar, final

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType
from numpy.random import Generator
from numpy.typing import NDArray

from feasibility.constants import AU, DAY_S, MU_SUN, mjd_to_mjd2000
from feasibility.dataset.samplers.draws import (
    Columns,
    Draw,
    check_ranges,
    collect,
    log_uniform,
    rayleigh_orbits,
)
from feasibility.dataset.samplers.free_ends import FreeEnds
from feasibility.dataset.samplers.impulsive import ImpulsiveGrid
from feasibility.legs import Legs, Spacecraft
from feasibility.orbits import Catalogue, cartesian_to_classical, classical_to_cartesian

_Positive = Annotated[float, Meta(gt=0)]
_Range = tuple[_Positive, _Positive]
_Share = Annotated[float, Meta(ge=0, le=1)]


@final
class AnySpacecraft(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="any-spacecraft",
):
    """Legs of spacecraft and orbits drawn over wide ranges; near and far pairs mixed.

    The departure orbit is drawn (log-uniform semi-major axis, Rayleigh
    distributed eccentricity and inclination, uniform angles) or is that of a
    catalogue body. The arrival orbit is drawn independently, or it is near:
    the departure orbit with all six elements disturbed, the longitude about
    where the departure body itself has coasted to. The size of the disturbance
    is log-uniform, so that every distance between next to nothing and far is
    there, and with it every margin.

    Parameters
    ----------
    start_mjd : pair of float
        Departure epochs.
    a_au : pair of float
        Semi-major axes.
    eccentricity_scale, inclination_scale_deg : float
        Modes of the Rayleigh distributions.
    perihelion_au_min : float
        No orbit comes nearer to the Sun.
    eccentricity_max : float
        No orbit is more eccentric.
    catalogue_share : float
        Share of departures from catalogue bodies with semi-major axes within `a_au`.
    near_share : float
        Share of near pairs.
    disturbance : pair of float
        Range of the relative disturbance of near pairs, log-uniform.
    revolutions : pair of float
        Flight times in periods of the smaller orbit, uniform.
    hohmann_share_min : float
        Independent pairs have at least this share of the Hohmann transfer's time:
        less is beyond any spacecraft of these ranges.
    acceleration_m_s2 : pair of float
        Thrust over initial mass, log-uniform.
    isp_s : pair of float
        Specific impulse, log-uniform.
    m0_kg : pair of float
        Initial mass, log-uniform.
    dry_share : pair of float
        Dry mass over initial mass, uniform.
    free_ends : FreeEnds, optional
        Shares of legs with excess velocities at their ends; none unless given.
    """

    draws_spacecraft: ClassVar[bool] = True

    start_mjd: _Range = (58849.0, 73459.0)
    a_au: _Range = (0.5, 6.0)
    eccentricity_scale: _Positive = 0.12
    inclination_scale_deg: _Positive = 7.0
    perihelion_au_min: _Positive = 0.3
    eccentricity_max: Annotated[float, Meta(gt=0, lt=1)] = 0.7
    catalogue_share: _Share = 0.25
    near_share: _Share = 0.6
    disturbance: _Range = (0.003, 0.3)
    revolutions: _Range = (0.05, 2.0)
    hohmann_share_min: Annotated[float, Meta(ge=0)] = 0.6
    acceleration_m_s2: _Range = (1e-5, 1e-3)
    isp_s: _Range = (1000.0, 6000.0)
    m0_kg: _Range = (100.0, 5000.0)
    dry_share: _Range = (0.2, 0.8)
    # Not among the settings unless it is given, as in datasets of before.
    free_ends: FreeEnds | UnsetType = UNSET

    def __post_init__(self) -> None:
        check_ranges(
            start_mjd=self.start_mjd,
            a_au=self.a_au,
            disturbance=self.disturbance,
            revolutions=self.revolutions,
            acceleration_m_s2=self.acceleration_m_s2,
            isp_s=self.isp_s,
            m0_kg=self.m0_kg,
            dry_share=self.dry_share,
        )

    def draw(
        self,
        n: int,
        rng: Generator,
        catalogue: Catalogue,
        spacecraft: Spacecraft | None,  # noqa: ARG002
        grid: ImpulsiveGrid,  # noqa: ARG002
    ) -> Draw:
        """Draw `n` legs; ids of drawn orbits are -1, dt_imp is not defined (NaN).

        Raises
        ------
        InputError
            Hardly an orbit is within the limits.
        """
        inner, outer = (AU * bound for bound in self.a_au)
        usable = np.flatnonzero(
            (catalogue.elements[:, 0] >= inner) & (catalogue.elements[:, 0] <= outer)
        )

        def batch(m: int) -> Columns:
            return self._orbit_pairs(m, rng, catalogue, usable)

        rows = collect(n, batch)
        m0 = log_uniform(rng, self.m0_kg, n)
        thrust = m0 * log_uniform(rng, self.acceleration_m_s2, n)
        slowest, fastest = self.acceleration_m_s2
        rv_dep = classical_to_cartesian(rows["departure"])
        rv_arr = classical_to_cartesian(rows["arrival"])
        isp = log_uniform(rng, self.isp_s, n)
        m_dry = m0 * rng.uniform(*self.dry_share, n)
        ends = FreeEnds() if isinstance(self.free_ends, UnsetType) else self.free_ends
        vinf_dep, vinf_arr = ends.draw(rng, rv_dep, rv_arr)
        legs = Legs(
            rv_dep=rv_dep,
            rv_arr=rv_arr,
            tof_days=rows["tof"],
            m0=m0,
            thrust=thrust,
            isp=isp,
            m_dry=m_dry,
            t_dep_mjd2000=rows["t_dep"],
            dep_id=rows["dep_id"],
            arr_id=np.full(n, -1),
            vinf_dep=vinf_dep,
            vinf_arr=vinf_arr,
        )
        return Draw(legs, np.full(n, np.nan), thrust / fastest, thrust / slowest)

    def _orbit_pairs(
        self, m: int, rng: Generator, catalogue: Catalogue, usable: NDArray[np.intp]
    ) -> Columns:
        """Draw m candidates and return those within the limits.

        Columns: elements (k, 6) of the departure orbit at departure and of the
        arrival orbit at arrival, flight time, epoch, id of the departure body.
        """
        t_dep = mjd_to_mjd2000(0.0) + rng.uniform(*self.start_mjd, m)
        departure = self._orbits(rng, m)
        dep_id = np.full(m, -1, dtype=np.int64)
        known = rng.uniform(size=m) < self.catalogue_share
        if len(usable) and known.any():
            rows = rng.choice(usable, int(known.sum()))
            departure[known] = cartesian_to_classical(catalogue.states_at(rows, t_dep[known]))
            dep_id[known] = catalogue.ids[rows]
        near = rng.uniform(size=m) < self.near_share
        size = log_uniform(rng, self.disturbance, m)
        disturbed = _disturbed(departure, size, rng.standard_normal((m, 6)))
        arrival = np.where(near[:, None], disturbed, self._orbits(rng, m))
        smaller = np.minimum(departure[:, 0], arrival[:, 0])
        tof_s = rng.uniform(*self.revolutions, m) * 2.0 * np.pi * np.sqrt(smaller**3 / MU_SUN)
        coasted = np.sqrt(MU_SUN / departure[:, 0] ** 3) * tof_s
        arrival[near, 5] += coasted[near]
        transfer = 0.5 * (departure[:, 0] + arrival[:, 0])
        hohmann_s = np.pi * np.sqrt(transfer**3 / MU_SUN)
        kept = near | (tof_s >= self.hohmann_share_min * hohmann_s)
        kept &= self._within(departure) & self._within(arrival)
        columns = {
            "departure": departure,
            "arrival": arrival,
            "tof": tof_s / DAY_S,
            "t_dep": t_dep,
            "dep_id": dep_id,
        }
        return {name: column[kept] for name, column in columns.items()}

    def _orbits(self, rng: Generator, m: int) -> NDArray[np.float64]:
        return rayleigh_orbits(
            rng, m, self.a_au, self.eccentricity_scale, self.inclination_scale_deg
        )

    def _within(self, elements: NDArray[np.float64]) -> NDArray[np.bool_]:
        a, e = elements[:, 0] / AU, elements[:, 1]
        low, high = self.a_au
        within: NDArray[np.bool_] = (
            (a >= low * (1 - 1e-12))
            & (a <= high * (1 + 1e-12))
            & (e <= self.eccentricity_max)
            & (a * (1.0 - e) >= self.perihelion_au_min)
            & (elements[:, 2] < 0.5 * np.pi)
        )
        return within


def _disturbed(
    elements: NDArray[np.float64], size: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return orbits with all six elements moved by about `size`, relative or in rad.

    Eccentricity and inclination move as vectors, so circular and plane orbits
    are no special case. The mean longitude moves three times as far: a
    spacecraft changes its phase in the orbit more easily than the orbit.
    """
    a, e, i, node, argp, anomaly = elements.T
    change = size * normal.T
    perihelion = node + argp
    ex = e * np.cos(perihelion) + 0.5 * change[1]
    ey = e * np.sin(perihelion) + 0.5 * change[2]
    ix = i * np.cos(node) + 0.5 * change[3]
    iy = i * np.sin(node) + 0.5 * change[4]
    new_node = np.arctan2(iy, ix)
    new_perihelion = np.arctan2(ey, ex)
    longitude = perihelion + anomaly + 3.0 * change[5]
    return np.column_stack(
        [
            a * np.exp(change[0]),
            np.hypot(ex, ey),
            np.hypot(ix, iy),
            new_node,
            new_perihelion - new_node,
            longitude - new_perihelion,
        ]
    )
