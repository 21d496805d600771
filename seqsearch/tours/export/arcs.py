"""`mission_arcs`: a flight as smooth arcs without gaps, as interpolating programs need it.

Within an arc nothing jumps, so a program may interpolate from row to row. Arcs end where the
velocity does jump, and where the spacecraft arrives or leaves. During stays it moves as the body.
"""

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S
from feasibility.errors import InputError
from seqsearch.tours.bodies.told_motion import motion_of
from seqsearch.tours.export.protocol import Flight
from seqsearch.tours.paths import epochs_between, row_step_days
from seqsearch.tours.trajectory import Phase

_NO_TIME_DAYS: Final = 1e-3 / DAY_S
"""A millisecond: what is shorter is rounding, neither a stay nor an arc."""

_OBLIQUITY_RAD: Final = np.radians(84381.448 / 3600.0)
"""Of the ecliptic J2000 against the equator, as IAU 1976 and SPICE's ECLIPJ2000 have it."""

_LINE: Final = 200
"""Longest line of a comment: OEM allows 254 characters."""

FRAME: Final = "mean equator and equinox J2000 (EME2000)"
"""What `equatorial` turns to, in words."""


@final
@dataclass(frozen=True, eq=False)
class Arc:
    """A smooth piece of a flight.

    With n the number of rows, at least two.

    Attributes
    ----------
    label : str
        What it is part of: a leg or a stay.
    stay : bool
        The spacecraft is at a body.
    number : int
        Number of the leg, from 1; of a stay that of the leg before it.
    t_mjd2000 : (n,) float64
        Epochs, rising.
    states : (n, 6) float64, m and m/s
        Heliocentric ecliptic J2000.
    mass_kg : (n,) float64
        Mass.
    thrust_n : (n, 3) float64, N
        Thrust from each row to the next.
    """

    label: str
    stay: bool
    number: int
    t_mjd2000: NDArray[np.float64]
    states: NDArray[np.float64]
    mass_kg: NDArray[np.float64]
    thrust_n: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.t_mjd2000)


def mission_arcs(flight: Flight) -> list[Arc]:
    """Return the arcs of a flight in order of time, each beginning when the one before ends.

    Raises
    ------
    InputError
        The trajectory has another number of phases than the tour has legs.
    """
    phases = flight.trajectory.phases
    if len(phases) != len(flight.tour.legs):
        raise InputError(
            f"the trajectory has {len(phases)} phases and the tour {len(flight.tour.legs)} legs, "
            "expected one phase a leg"
        )
    arcs: list[Arc] = []
    for number, phase in enumerate(phases, 1):
        arcs += _smooth(phase, number)
        if number < len(phases):
            arcs += _stay(flight, number)
    return list(_joined(arcs))


def equatorial(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn (n, 6) states from the ecliptic to the mean equator of J2000."""
    cosine, sine = np.cos(_OBLIQUITY_RAD), np.sin(_OBLIQUITY_RAD)
    turned = states.copy()
    for y, z in ((1, 2), (4, 5)):
        turned[:, y] = cosine * states[:, y] - sine * states[:, z]
        turned[:, z] = sine * states[:, y] + cosine * states[:, z]
    return turned


def words(flight: Flight) -> list[str]:
    """Return what files say about a flight, as lines of plain ASCII."""
    rules = flight.tour.rules
    model = (
        "continuous thrust, constant from a row to the next"
        if flight.trajectory.continuous
        else "impulses (Sims-Flanagan), not refined: coasting arcs, velocity jumps between them"
    )
    lines = [
        f"problem {rules.name}, bodies {flight.tour.one_line()}",
        f"model: {model}",
        f"during stays the spacecraft moves as the body; Sun's mu {rules.mu_m3_s2:.17g} m3/s2",
    ]
    return [part for line in lines for part in textwrap.wrap(plain(line), _LINE)]


def plain(text: str) -> str:
    """Return a text as one line of printable ASCII."""
    ascii_text = text.encode("ascii", "backslashreplace").decode()
    return "".join(c if c.isprintable() else " " for c in ascii_text)


def _smooth(phase: Phase, number: int) -> list[Arc]:
    """Cut a phase where two rows have one epoch."""
    jumps = np.flatnonzero(np.diff(phase.t_mjd2000) <= 0.0) + 1
    bounds = [0, *jumps.tolist(), len(phase)]
    label = f"leg {number}: {phase.start} -> {phase.end}"
    return [
        Arc(
            label,
            False,
            number,
            phase.t_mjd2000[a:b],
            phase.states[a:b],
            phase.mass_kg[a:b],
            phase.thrust_n[a:b],
        )
        for a, b in pairwise(bounds)
        if b - a >= 2
    ]


def _stay(flight: Flight, number: int) -> list[Arc]:
    """Return the stay after a leg; none where the next begins at once."""
    phase, following = flight.trajectory.phases[number - 1 : number + 1]
    begin, end = phase.t_mjd2000[-1], following.t_mjd2000[0]
    if end - begin <= _NO_TIME_DAYS:
        return []
    body = flight.tour.body(flight.tour.legs[number - 1].to_id)
    mu = flight.tour.rules.mu_m3_s2
    epochs = epochs_between(begin, end, row_step_days(phase.states[-1], mu))
    return [
        Arc(
            f"stay at {phase.end}",
            True,
            number,
            epochs,
            motion_of(flight.tour, body, epochs),
            np.full(len(epochs), following.mass_kg[0]),
            np.zeros((len(epochs), 3)),
        )
    ]


def _joined(arcs: list[Arc]) -> Iterator[Arc]:
    """Let each arc begin exactly when the one before ends: rounding leaves no gap."""
    end = arcs[0].t_mjd2000[0]
    for arc in arcs:
        epochs = arc.t_mjd2000.copy()
        epochs[0] = end
        end = epochs[-1]
        yield Arc(arc.label, arc.stay, arc.number, epochs, arc.states, arc.mass_kg, arc.thrust_n)
