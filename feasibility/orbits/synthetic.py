"""A synthetic main belt: the embedded catalogue, for which no file is needed."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, MJD2000_MJD
from feasibility.errors import InputError
from feasibility.orbits.catalogue import Catalogue

_EPOCH_MJD: Final = 56800.0
"""Epoch of the elements, the one of the GTOC7 table."""

_GAPS: Final = (
    # columns: a of the resonance and width in AU; share missing at the centre
    (2.065, 0.020, 1.0),  # 4:1
    (2.502, 0.025, 1.0),  # 3:1
    (2.825, 0.017, 1.0),  # 5:2
    (2.958, 0.010, 0.7),  # 7:3
    (3.279, 0.030, 1.0),  # 2:1
)
"""Kirkwood gaps of the p:q resonances, a = 5.2026 AU (q/p)^(2/3), as Gaussian wells.

Widths and depths are read off the histogram of the real belt.
"""

_ZONES: Final = np.array(
    [
        # columns: share; a from and to in AU; mode of e; mode of i in degrees
        [0.010, 1.80, 2.00, 0.06, 18.0],  # Hungarias
        [0.215, 2.16, 2.50, 0.13, 6.5],  # inner belt
        [0.265, 2.50, 2.825, 0.13, 9.0],  # middle belt
        [0.035, 2.825, 2.958, 0.10, 8.0],  # between 5:2 and 7:3
        [0.155, 2.958, 3.28, 0.12, 11.0],  # outer belt
        [0.008, 3.28, 3.60, 0.09, 10.0],  # Cybeles
    ]
)
"""The background: uniform in a, Rayleigh in e and i, zones divided by the gaps."""

_FAMILIES: Final = np.array(
    [
        # columns: share; a and its spread in AU; e; i in degrees
        [0.060, 2.26, 0.040, 0.13, 5.0],  # Flora
        [0.035, 2.36, 0.040, 0.10, 6.6],  # Vesta
        [0.035, 2.41, 0.035, 0.17, 2.5],  # Nysa-Polana
        [0.035, 2.56, 0.030, 0.10, 14.8],  # Maria
        [0.050, 2.63, 0.045, 0.15, 13.2],  # Eunomia
        [0.030, 2.70, 0.040, 0.17, 4.5],  # Adeona, Astrid and their like
        [0.035, 2.78, 0.025, 0.13, 9.0],  # Gefion, Ceres
        [0.030, 2.88, 0.025, 0.05, 2.1],  # Koronis
        [0.055, 3.01, 0.045, 0.075, 10.2],  # Eos
        [0.040, 3.13, 0.045, 0.15, 1.5],  # Themis
        [0.020, 3.15, 0.045, 0.13, 5.2],  # Hygiea
    ]
)
"""The large collisional families, near the proper elements of their largest members (AstDyS)."""

_FAMILY_SPREAD_E: Final = 0.03
_FAMILY_SPREAD_I_DEG: Final = 0.9
"""Osculating elements of a family scatter more than its proper ones: forced oscillations."""

_MIN_PERIHELION_AU: Final = 1.666
"""Mars' aphelion: what comes nearer to the Sun is a Mars crosser, not a main-belt asteroid."""
_MAX_APHELION_AU: Final = 4.6
"""Well inside Jupiter's perihelion of 4.95 AU."""
_MAX_INCLINATION_DEG: Final = 35.0


def synthetic_main_belt(n: int, rng: np.random.Generator) -> Catalogue:
    """Draw a main belt with the structure of the real one.

    Semi-major axes from 1.8 to 3.6 AU in zones divided by the Kirkwood gaps,
    eleven collisional families over a background with Rayleigh distributed
    eccentricities and inclinations, uniform angles, no orbit that crosses
    Mars' aphelion or nears Jupiter. Means, the histogram of a, and the
    distance of neighbours in the orbital metric resemble those of the GTOC
    tables, so that tours of similar length exist.

    Parameters
    ----------
    n : int
        Number of asteroids, 1 to 10 million.
    rng : numpy.random.Generator
        The same generator state gives the same belt.

    Returns
    -------
    Catalogue
        ids 1 to n, names "S00001" and so on, epoch MJD 56800.

    Raises
    ------
    InputError
        `n` is out of range.
    """
    if not 1 <= n <= 10_000_000:
        raise InputError(f"synthetic main belt: {n} bodies, expected 1 to 10 million")
    parts: list[NDArray[np.float64]] = []
    missing = n
    while missing > 0:
        drawn = _draw(2 * missing + 100, rng)[:missing]
        parts.append(drawn)
        missing -= len(drawn)
    elements = np.empty((n, 6))
    elements[:, :3] = np.concatenate(parts)
    elements[:, 3:] = rng.uniform(0.0, 2.0 * np.pi, (n, 3))
    elements[:, 0] *= AU
    elements[:, 2] = np.radians(elements[:, 2])
    return Catalogue(
        ids=np.arange(1, n + 1),
        names=[f"S{identity:05d}" for identity in range(1, n + 1)],
        epoch_mjd2000=_EPOCH_MJD - MJD2000_MJD,
        elements=elements,
        source=f"synthetic main belt of {n}",
    )


def _draw(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return (m, 3), m <= count: a [AU], e, i [deg] of the candidates that nature would keep."""
    shares = np.concatenate([_ZONES[:, 0], _FAMILIES[:, 0]])
    origin = rng.choice(len(shares), size=count, p=shares / shares.sum())
    in_family = origin >= len(_ZONES)
    zone = _ZONES[np.where(in_family, 0, origin)]
    family = _FAMILIES[np.where(in_family, origin - len(_ZONES), 0)]

    place = rng.uniform(size=count)
    scatter = rng.standard_normal((count, 3))
    a = np.where(
        in_family,
        family[:, 1] + family[:, 2] * scatter[:, 0],
        zone[:, 1] + (zone[:, 2] - zone[:, 1]) * place,
    )
    e = np.where(
        in_family,
        np.abs(family[:, 3] + _FAMILY_SPREAD_E * scatter[:, 1]),
        rng.rayleigh(zone[:, 3]),
    )
    i = np.where(
        in_family,
        np.abs(family[:, 4] + _FAMILY_SPREAD_I_DEG * scatter[:, 2]),
        rng.rayleigh(zone[:, 4]),
    )
    kept = np.ones(count)
    for centre, width, depth in _GAPS:
        kept *= 1.0 - depth * np.exp(-0.5 * ((a - centre) / width) ** 2)
    keep = (
        (rng.uniform(size=count) < kept)
        & (a >= 1.8)
        & (a <= 3.6)
        & (a * (1.0 - e) > _MIN_PERIHELION_AU)
        & (a * (1.0 + e) < _MAX_APHELION_AU)
        & (i < _MAX_INCLINATION_DEG)
    )
    return np.column_stack([a, e, i])[keep]
