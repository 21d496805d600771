"""SPK kernels that tests write with spiceypy."""

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import spiceypy
from numpy.typing import NDArray

from feasibility.constants import AU, DAY_S
from feasibility.orbits import Catalogue

States = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""(k,) MJD2000 to (k, 6) heliocentric ecliptic states, m and m/s."""


@functools.cache
def belt(bodies: int = 12, seed: int = 5) -> Catalogue:
    """Return the bodies whose motion the kernels have: a family, so that legs can be flown."""
    rng = np.random.default_rng(seed)
    spread = rng.uniform(-1.0, 1.0, (bodies, 6)) * [0.01 * AU, 0.01, 0.01, 0.02, 0.02, 0.05]
    elements = np.array([2.4 * AU, 0.05, 0.05, 1.0, 2.0, 3.0]) + spread
    return Catalogue(range(1, bodies + 1), ["family"] * bodies, 11000.0, elements, "family")


def kepler_states(row: int, push_m: float = 0.0) -> States:
    """Return the motion of a body of `belt`, off its ellipse by up to `push_m` metres."""
    catalogue = belt()

    def states(t_mjd2000: NDArray[np.float64]) -> NDArray[np.float64]:
        found = catalogue.states_at(np.full(len(t_mjd2000), row), t_mjd2000)
        rate = 2.0 * np.pi / 900.0
        found[:, 2] += push_m * np.sin(rate * t_mjd2000)
        found[:, 5] += push_m * rate / DAY_S * np.cos(rate * t_mjd2000)
        return found

    return states


def seconds(t_mjd2000: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return seconds of TDB past J2000."""
    return (np.asarray(t_mjd2000) - 0.5) * DAY_S


def write_kernel(
    path: Path,
    body: int,
    states: States,
    start: float,
    end: float,
    *,
    centre: int = 10,
    frame: str = "ECLIPJ2000",
    kind: int = 13,
    step_days: float = 2.0,
) -> None:
    """Write a segment, into a new file or one that is there; epochs are MJD2000."""
    epochs = np.linspace(start, end, int(np.ceil((end - start) / step_days)) + 1)
    if frame in ("ECLIPJ2000", "J2000"):
        turn = spiceypy.pxform("ECLIPJ2000", frame, 0.0)
    else:
        turn = np.eye(3)
    found = states(epochs) / 1e3
    turned = np.ascontiguousarray(np.hstack([found[:, :3] @ turn.T, found[:, 3:] @ turn.T]))
    handle = spiceypy.spkopa(str(path)) if path.exists() else spiceypy.spkopn(str(path), "test", 0)
    times = seconds(epochs)
    try:
        write = {13: spiceypy.spkw13, 9: spiceypy.spkw09}[kind]
        write(
            handle, body, centre, frame, times[0], times[-1], "test", 7, len(times), turned, times
        )
    finally:
        spiceypy.spkcls(handle)
