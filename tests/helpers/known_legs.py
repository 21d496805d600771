"""Legs with free ends out of competitions: published launches, and fly-bys like those flown."""

from pathlib import Path

import numpy as np

from feasibility.constants import AU, DAY_S, MU_SUN, mjd_to_mjd2000
from feasibility.legs import Legs, Spacecraft
from feasibility.orbits import read_catalogue
from feasibility.orbits.earth import earth
from feasibility.orbits.kepler_kernels import propagate_batch

_JD_MJD = 2_400_000.5

# Asteroid, launch epoch (JD), days, C3 (km2/s2), final mass (kg): the shortest first legs that JPL
# found. The thrust is full all the way, so 4000 kg is the largest mass that can be flown.
_LAUNCHES = np.array(
    [
        (1712, 2459127.7064, 53.9, 6.3, 3952.5),
        (5029, 2460657.0970, 66.5, 21.0, 3941.4),
        (6259, 2460176.5848, 67.2, 25.0, 3940.8),
        (5264, 2457396.4443, 74.5, 9.3, 3934.4),
    ]
)
LAUNCH_SPEED = 1e3 * np.sqrt(_LAUNCHES[:, 3])
"""(4,) m/s, the published excess speeds."""

FINAL_MASS = _LAUNCHES[:, 4]
"""(4,) kg, the published final masses."""


def published_launches(tables: Path, vinf_dep) -> Legs:
    """Return the four launches with a bound of the excess speed in m/s."""
    table = read_catalogue(tables / "GTOC5-DATA.txt")
    body, julian, days = _LAUNCHES[:, 0].astype(int), _LAUNCHES[:, 1], _LAUNCHES[:, 2]
    epoch = mjd_to_mjd2000(julian - _JD_MJD)
    return Legs(
        earth().states_at(np.zeros(len(body), dtype=int), epoch),
        table.states_at(table.rows_of(body), epoch + days),
        days,
        m0=4000.0,
        thrust=0.3,
        isp=3000.0,
        m_dry=500.0,
        vinf_dep=vinf_dep,
    )


def fly_bys_like_those_flown(tables: Path, n: int, seed: int) -> Legs:
    """Return n legs of 75 days from one fly-by to the next: positions, any speed.

    The spacecraft passes an asteroid at 0.7 to 1.4 AU on an orbit near a circle, as after a launch
    from the Earth. The next is within 0.02 AU of where it would coast to in 75 days.

    Raises
    ------
    ValueError
        There are fewer than n.
    """
    table = read_catalogue(tables / "GTOC4-DATA.txt")
    rng = np.random.default_rng(seed)
    many, days, near = 800 * n, 75.0, 0.02 * AU
    first, passed = (
        rng.integers(0, len(table), many),
        mjd_to_mjd2000(rng.uniform(57023, 61041, many)),
    )
    there = table.states_at(first, passed)[:, :3]
    radius = np.linalg.norm(there, axis=1)
    along = np.cross([0.0, 0.0, 1.0], there)
    along *= (np.sqrt(MU_SUN / radius) / np.linalg.norm(along, axis=1))[:, None]
    velocity = along + rng.normal(0.0, 2000.0, (many, 3))
    departures, arrivals = [], []
    for row in np.flatnonzero((radius > 0.7 * AU) & (radius < 1.4 * AU)):
        departure = np.concatenate([there[row], velocity[row]])
        coasted = propagate_batch(departure[None], np.array([days * DAY_S]), MU_SUN)[0]
        others = np.flatnonzero(np.arange(len(table)) != first[row])
        states = table.states_at(others, passed[row] + days)
        distance = np.linalg.norm(states[:, :3] - coasted[:3], axis=1)
        if distance.min() < near:
            departures.append(departure)
            arrivals.append(states[distance.argmin()])
        if len(arrivals) == n:
            craft = Spacecraft(m_dry=500.0, thrust=0.135, isp=3000.0)
            spacecraft = (1500.0, craft.thrust, craft.isp, craft.m_dry)
            return Legs(departures, arrivals, days, *spacecraft, vinf_arr=np.inf)
    raise ValueError(f"{len(arrivals)} legs, expected {n}")
