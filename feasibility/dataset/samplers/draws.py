"""`Draw`: legs as a sampler proposes them, before anything is solved; and what samplers share."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from feasibility.constants import AU
from feasibility.errors import InputError
from feasibility.legs import Legs, Spacecraft
from feasibility.orbits import Catalogue

Columns = dict[str, NDArray[Any]]

_LEAST_ACCEPTANCE: Final = 1e-4
_FIRST_BATCHES: Final = 50
"""Batches before a sampler that accepts almost nothing is given up."""


@final
@dataclass(frozen=True, eq=False)
class Draw:
    """What a sampler draws.

    Attributes
    ----------
    legs : Legs
        n legs with epochs and ids.
    dt_imp_days : (n,) float64
        Flight time of the cheapest impulsive transfer; NaN where the sampler has none.
    m0_min, m0_max : (n,) float64, kg
        Range of initial masses that the protocol speaks about.
    """

    legs: Legs
    dt_imp_days: NDArray[np.float64]
    m0_min: NDArray[np.float64]
    m0_max: NDArray[np.float64]

    def head(self, n: int) -> "Draw":
        """Return the first `n` legs."""
        return Draw(
            self.legs.take(np.arange(n)), self.dt_imp_days[:n], self.m0_min[:n], self.m0_max[:n]
        )


def collect(n: int, batch: Callable[[int], Columns]) -> Columns:
    """Call `batch` until it has accepted `n` rows in all, and return the first `n`.

    Parameters
    ----------
    n : int
        Rows wanted.
    batch : callable
        Draws the given number of candidates and returns the columns of those it accepts.

    Raises
    ------
    InputError
        Almost no candidate is accepted.
    """
    parts: list[Columns] = []
    accepted = proposed = 0
    while accepted < n:
        # Half as many again: most batches end in one or two rounds.
        candidates = (n - accepted) * 3 // 2 + 16
        part = batch(candidates)
        parts.append(part)
        accepted += len(next(iter(part.values())))
        proposed += candidates
        if len(parts) >= _FIRST_BATCHES and accepted < _LEAST_ACCEPTANCE * proposed:
            raise InputError(
                f"sampler: only {accepted} of {proposed} drawn legs are within its limits; "
                "expected limits that keep more of the catalogue's pairs"
            )
    return {name: np.concatenate([part[name] for part in parts])[:n] for name in parts[0]}


def log_uniform(rng: Generator, bounds: tuple[float, float], n: int) -> NDArray[np.float64]:
    """Draw (n,) numbers, as many in each octave between two bounds."""
    low, high = np.log(bounds)
    return np.exp(rng.uniform(low, high, n))


def rayleigh_orbits(
    rng: Generator,
    n: int,
    a_au: tuple[float, float],
    eccentricity_scale: float,
    inclination_scale_deg: float,
) -> NDArray[np.float64]:
    """Draw (n, 6) classical elements, m and rad.

    Semi-major axes are log-uniform, eccentricities (which may exceed 1) and inclinations Rayleigh
    distributed about the modes given, and angles uniform.
    """
    elements = np.empty((n, 6))
    elements[:, 0] = AU * log_uniform(rng, a_au, n)
    elements[:, 1] = rng.rayleigh(eccentricity_scale, n)
    elements[:, 2] = np.radians(rng.rayleigh(inclination_scale_deg, n))
    elements[:, 3:] = rng.uniform(0.0, 2.0 * np.pi, (n, 3))
    return elements


def check_pairs(catalogue: Catalogue) -> None:
    """Raise InputError where a catalogue has no pair of bodies."""
    if len(catalogue) < 2:
        raise InputError(
            f"{catalogue.source}: {len(catalogue)} bodies, expected two or more to draw pairs"
        )


_MOST: Final = {
    "start_mjd": (200_000.0, "; is it a Julian date?"),
    "m0_kg": (1e7, "; is it in g?"),
    "tof_days": (1e5, "; is it in seconds?"),
    "long_tof_days": (1e5, "; is it in seconds?"),
    "tof_ratio": (1e3, ""),
    "a_au": (1e3, "; is it in km?"),
    "disturbance": (10.0, ""),
    "revolutions": (100.0, ""),
    "acceleration_m_s2": (0.01, ""),
    "vinf_km_s": (300.0, "; is it in m/s?"),
    "excess_of_circular": (10.0, "; is it in km/s?"),
    "isp_s": (2e4, "; is it in m/s, an exhaust velocity?"),
    "dry_share": (1.0, ""),
}
"""Largest numbers of ranges, and what larger ones usually are."""


def check_ranges(**ranges: tuple[float, float]) -> None:
    """Raise ValueError where a pair of numbers is not in order, or beyond all sense."""
    for name, (low, high) in ranges.items():
        if low > high:
            raise ValueError(f"{name} = [{low:g}, {high:g}], expected the smaller number first")
        most, slip = _MOST.get(name, (np.inf, ""))
        if high > most:
            raise ValueError(f"{name} = [{low:g}, {high:g}], expected at most {most:g}{slip}")


def legs_of_pairs(
    catalogue: Catalogue, rows: Columns, m0: NDArray[np.float64], spacecraft: Spacecraft
) -> Legs:
    """Return the legs of drawn pairs: columns "dep", "arr" (rows), "t_dep" (MJD2000), "tof"."""
    return Legs(
        rv_dep=catalogue.states_at(rows["dep"], rows["t_dep"]),
        rv_arr=catalogue.states_at(rows["arr"], rows["t_dep"] + rows["tof"]),
        tof_days=rows["tof"],
        m0=m0,
        thrust=spacecraft.thrust,
        isp=spacecraft.isp,
        m_dry=spacecraft.m_dry,
        t_dep_mjd2000=rows["t_dep"],
        dep_id=catalogue.ids[rows["dep"]],
        arr_id=catalogue.ids[rows["arr"]],
    )
