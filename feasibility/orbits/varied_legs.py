"""What a check of a contract asks about: legs of all kinds, and the same legs in other batches."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, MU_SUN
from feasibility.legs import Legs

_N_LEGS: Final = 64
_ALONE: Final = 5
"""Things that are asked about alone."""


def regroupings(
    n: int, rng: np.random.Generator, thing: str = "leg"
) -> list[tuple[str, NDArray[np.intp]]]:
    """Return batches of rows of n things in which a row-wise answer for each stays the same.

    Parameters
    ----------
    n : int
        Number of things.
    rng : numpy.random.Generator
        Shuffles them.
    thing : str
        What they are.

    Returns
    -------
    list of (str, (k,) intp)
        What is done to the things, as the end of a sentence, and their rows.
    """
    every = np.arange(n)
    batches: list[tuple[str, NDArray[np.intp]]] = [
        (f"the {thing}s are reversed", every[::-1]),
        (f"the {thing}s are shuffled", rng.permutation(n)),
        ("the first half is asked alone", every[: n // 2]),
        ("the second half is asked alone", every[n // 2 :]),
        (f"each {thing} is asked twice", np.repeat(every, 2)),
    ]
    batches += [
        (f"{thing} {row} is asked alone", every[row : row + 1]) for row in range(min(n, _ALONE))
    ]
    return batches


def varied_legs(rng: np.random.Generator) -> Legs:
    """Draw 64 legs between nearly circular orbits, half in the main belt and half near the Earth.

    Some are easy, some far beyond any engine; masses, thrusts and exhaust velocities differ.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws everything.
    """
    n = _N_LEGS
    semi = np.where(np.arange(n) % 2 == 0, rng.uniform(2.1, 3.3, n), rng.uniform(0.8, 1.4, n)) * AU

    def log_uniform(low: float, high: float) -> NDArray[np.float64]:
        return np.exp(rng.uniform(np.log(low), np.log(high), n))

    departure = _states(rng, semi, rng.uniform(0.0, 2.0 * np.pi, n))
    tof_days = log_uniform(40.0, 1500.0)
    # Arrivals near the coasted departure body, and away from it.
    turned = tof_days * 86400.0 * np.sqrt(MU_SUN / semi**3)
    longitude = np.arctan2(departure[:, 1], departure[:, 0]) + turned
    longitude += rng.normal(0.0, 0.3, n) * rng.integers(0, 2, n)
    arrival = _states(rng, semi * rng.uniform(0.95, 1.05, n), longitude)
    m_dry = rng.uniform(300.0, 900.0, n)
    return Legs(
        rv_dep=departure,
        rv_arr=arrival,
        tof_days=tof_days,
        m0=m_dry * rng.uniform(1.0, 4.0, n),
        thrust=log_uniform(0.05, 1.0),
        isp=rng.uniform(1500.0, 5000.0, n),
        m_dry=m_dry,
    )


def _states(
    rng: np.random.Generator, radius: NDArray[np.float64], longitude: NDArray[np.float64]
) -> NDArray[np.float64]:
    n = len(radius)
    speed = np.sqrt(MU_SUN / radius)
    state = np.column_stack(
        [
            radius * np.cos(longitude),
            radius * np.sin(longitude),
            radius * rng.normal(0.0, 0.05, n),
            -speed * np.sin(longitude),
            speed * np.cos(longitude),
            speed * rng.normal(0.0, 0.05, n),
        ]
    )
    state[:, 3:] *= 1.0 + rng.normal(0.0, 0.05, (n, 1))
    return state
