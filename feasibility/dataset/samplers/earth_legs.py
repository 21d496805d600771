"""Sampler of legs that leave the Earth or come back to it with some speed."""

from typing import Annotated, ClassVar, Final, Literal, final

import msgspec
import numpy as np
from msgspec import Meta
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
from feasibility.dataset.samplers.impulsive import ImpulsiveGrid
from feasibility.legs import Legs, Spacecraft
from feasibility.orbits import Catalogue, classical_to_cartesian
from feasibility.orbits.earth import earth

_Positive = Annotated[float, Meta(gt=0)]
_Range = tuple[_Positive, _Positive]
_Share = Annotated[float, Meta(ge=0, le=1)]

_MOST_ECCENTRIC: Final = 0.6
"""Larger eccentricities of drawn orbits are cut to this."""


@final
class EarthLegs(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="earth-legs",
):
    """Launches from the Earth, or arrivals at it, with an excess velocity; any spacecraft.

    The other end is on a drawn orbit near that of the Earth, or at a body of the catalogue.

    Parameters
    ----------
    earth : "departure" or "arrival"
        Which end is at the Earth.
    vinf_km_s : pair of float
        Largest excess velocity there, uniform.
    fly_bys : float
        Share of legs that only pass the other end, at any speed.
    start_mjd : pair of float
        Departure epochs, uniform.
    tof_days : pair of float
        Flight times, uniform.
    hohmann_share_min : float
        No leg has less than this share of the Hohmann transfer's time.
    near_earth_share : float
        Share of other ends on drawn orbits.
    a_au : pair of float
        Semi-major axes of these, log-uniform.
    eccentricity_scale, inclination_scale_deg : float
        Modes of their Rayleigh distributions.
    acceleration_m_s2, isp_s, m0_kg : pair of float
        Thrust over initial mass, specific impulse and initial mass, log-uniform.
    dry_share : pair of float
        Dry mass over initial mass, uniform.
    """

    draws_spacecraft: ClassVar[bool] = True

    earth: Literal["departure", "arrival"] = "departure"
    vinf_km_s: _Range = (0.5, 6.0)
    fly_bys: _Share = 0.0
    start_mjd: _Range = (58849.0, 73459.0)
    tof_days: _Range = (100.0, 1200.0)
    hohmann_share_min: Annotated[float, Meta(ge=0)] = 0.5
    near_earth_share: _Share = 0.6
    a_au: _Range = (0.75, 1.7)
    eccentricity_scale: _Positive = 0.12
    inclination_scale_deg: _Positive = 5.0
    acceleration_m_s2: _Range = (3e-5, 1e-3)
    isp_s: _Range = (1500.0, 5000.0)
    m0_kg: _Range = (300.0, 5000.0)
    dry_share: _Range = (0.2, 0.8)

    def __post_init__(self) -> None:
        check_ranges(
            vinf_km_s=self.vinf_km_s,
            start_mjd=self.start_mjd,
            tof_days=self.tof_days,
            a_au=self.a_au,
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
        """Draw `n` legs; the Earth and drawn orbits have id -1, dt_imp is not defined (NaN).

        Raises
        ------
        InputError
            Hardly a leg is within the limits.
        """

        def batch(m: int) -> Columns:
            return self._batch(m, rng, catalogue)

        rows = collect(n, batch)
        m0 = log_uniform(rng, self.m0_kg, n)
        slowest, fastest = self.acceleration_m_s2
        thrust = m0 * log_uniform(rng, self.acceleration_m_s2, n)
        bound = 1e3 * rng.uniform(*self.vinf_km_s, n)
        other = np.where(rng.uniform(size=n) < self.fly_bys, np.inf, 0.0)
        unknown = np.full(n, -1)
        launch = self.earth == "departure"
        legs = Legs(
            rv_dep=rows["earth" if launch else "other"],
            rv_arr=rows["other" if launch else "earth"],
            tof_days=rows["tof"],
            m0=m0,
            thrust=thrust,
            isp=log_uniform(rng, self.isp_s, n),
            m_dry=m0 * rng.uniform(*self.dry_share, n),
            t_dep_mjd2000=rows["t_dep"],
            dep_id=unknown if launch else rows["id"],
            arr_id=rows["id"] if launch else unknown,
            vinf_dep=bound if launch else other,
            vinf_arr=other if launch else bound,
        )
        return Draw(legs, np.full(n, np.nan), thrust / fastest, thrust / slowest)

    def _batch(self, m: int, rng: Generator, catalogue: Catalogue) -> Columns:
        """Draw m candidates and return those within the limits."""
        t_dep = mjd_to_mjd2000(0.0) + rng.uniform(*self.start_mjd, m)
        tof = rng.uniform(*self.tof_days, m)
        here, there = (t_dep, t_dep + tof) if self.earth == "departure" else (t_dep + tof, t_dep)
        rows = rng.integers(0, len(catalogue), m)
        other = catalogue.states_at(rows, there)
        ids = catalogue.ids[rows].copy()
        elements = self._near_earth(rng, m)
        drawn = rng.uniform(size=m) < self.near_earth_share
        other[drawn] = classical_to_cartesian(elements[drawn])
        ids[drawn] = -1
        radius = np.linalg.norm(other[:, :3], axis=1)
        speed2 = np.einsum("ij,ij->i", other[:, 3:], other[:, 3:])
        semi = 1.0 / (2.0 / radius - speed2 / MU_SUN)
        hohmann = np.pi * np.sqrt((0.5 * (np.abs(semi) + AU)) ** 3 / MU_SUN) / DAY_S
        kept = (semi > 0.0) & (tof >= self.hohmann_share_min * hohmann)
        columns = {
            "earth": earth().states_at(np.zeros(m, dtype=np.int64), here),
            "other": other,
            "id": ids,
            "tof": tof,
            "t_dep": t_dep,
        }
        return {name: column[kept] for name, column in columns.items()}

    def _near_earth(self, rng: Generator, m: int) -> NDArray[np.float64]:
        elements = rayleigh_orbits(
            rng, m, self.a_au, self.eccentricity_scale, self.inclination_scale_deg
        )
        elements[:, 1] = np.minimum(elements[:, 1], _MOST_ECCENTRIC)
        return elements
