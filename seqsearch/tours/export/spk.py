"""``spk`` and ``spk13``: kernels for SPICE and what reads its files, written with spiceypy.

``spk`` is of type 9 and linear between rows that stand densely, as jplephem, skyfield and
astropy read no other type of unequal steps. ``spk13`` is of type 13 (Hermite), with the rows of
the flight and a thirtieth of the size, for SPICE itself.
"""

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.runtime.atomic import atomic_path
from seqsearch.tours.export.arcs import FRAME, Arc, equatorial, mission_arcs, words
from seqsearch.tours.export.epochs import seconds_past_j2000
from seqsearch.tours.export.protocol import Flight

SPACECRAFT: Final = -999
"""NAIF's number of the spacecraft in kernels."""

_SUN: Final = 10
_FRAME: Final = "J2000"
_COMMENT_CHARACTERS: Final = 10_000
_DEGREE: Final = 3
"""Hermite through two rows: exact to metres, and never across a change of thrust."""

_CHORD_M: Final = 300.0
"""Largest distance between a chord of ``spk`` and the arc; a third of a kilometre."""

_JUMP_S: Final = 1e-3
"""A jump of the velocity takes a millisecond in ``spk``, where epochs have to rise."""


@final
class SpkExporter:
    """Writes a kernel of type 9, degree 1: one segment for the whole mission."""

    name = "spk"

    def write(self, flight: Flight, path: Path, /) -> None:
        """Write the kernel.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        rows = [_dense(arc, flight.tour.rules.mu_m3_s2) for arc in mission_arcs(flight)]
        et, states = _with_jumps(rows)

        def fill(spice: Any, handle: int) -> None:
            spice.spkw09(
                handle, SPACECRAFT, _SUN, _FRAME, et[0], et[-1], "mission", 1, len(et), states, et
            )

        _write(flight, path, fill)


@final
class Spk13Exporter:
    """Writes a kernel of type 13, degree 3: a segment for each smooth arc, stays included."""

    name = "spk13"

    def write(self, flight: Flight, path: Path, /) -> None:
        """Write the kernel; see `SpkExporter.write`."""
        arcs = mission_arcs(flight)

        def fill(spice: Any, handle: int) -> None:
            for arc in arcs:
                et, states = seconds_past_j2000(arc.t_mjd2000), equatorial(arc.states) / 1e3
                spice.spkw13(
                    handle,
                    SPACECRAFT,
                    _SUN,
                    _FRAME,
                    et[0],
                    et[-1],
                    arc.label[:40],
                    _DEGREE,
                    len(et),
                    states,
                    et,
                )

        _write(flight, path, fill)


def _write(flight: Flight, path: Path, fill: Callable[[Any, int], None]) -> None:
    # Imported here: it loads SPICE, which the other formats do not need.
    import spiceypy as spice

    # SPICE makes its files itself, and cuts names off after 255 characters.
    with atomic_path(path) as temporary, tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "tour.bsp"
        try:
            handle = spice.spkopn(str(made), "seqsearch", _COMMENT_CHARACTERS)
            try:
                spice.dafac(handle, _comment(flight))
                fill(spice, handle)
            finally:
                spice.spkcls(handle)
        except spice.utils.exceptions.SpiceyError as error:
            raise InputError(f"{path}: SPICE cannot write it ({_reason(error)})") from None
        shutil.copyfile(made, temporary)


def _reason(error: Exception) -> str:
    """Return what SPICE says in a few words, without the path through its routines."""
    return " ".join(str(getattr(error, "long", None) or error).split())[:160]


def _comment(flight: Flight) -> list[str]:
    return [
        *words(flight),
        f"body {SPACECRAFT} relative to the Sun ({_SUN}), km and km/s, TDB",
        f"turned from the ecliptic J2000 to the {FRAME}",
    ]


def _dense(arc: Arc, mu: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (m,) s past J2000 and (m, 6) states in m, close enough for straight chords."""
    et = seconds_past_j2000(arc.t_mjd2000)
    steps = np.diff(et)
    radius = np.linalg.norm(arc.states[:, :3], axis=1)
    thrust = np.linalg.norm(arc.thrust_n, axis=1) / arc.mass_kg
    pull = mu / np.minimum(radius[:-1], radius[1:]) ** 2 + thrust[:-1]
    pieces = np.maximum(1, np.ceil(steps * np.sqrt(pull / (8.0 * _CHORD_M)))).astype(np.intp)
    row = np.repeat(np.arange(len(steps)), pieces)
    first = np.cumsum(pieces) - pieces
    share = (np.arange(len(row)) - first[row]) / pieces[row]
    states = np.vstack([_hermite(arc.states, steps, row, share), arc.states[-1:]])
    return np.append(et[row] + share * steps[row], et[-1]), equatorial(states)


def _hermite(
    states: NDArray[np.float64],
    steps: NDArray[np.float64],
    row: NDArray[np.intp],
    share: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the states at a share of the way from a row to the next."""
    h, s = steps[row][:, None], share[:, None]
    x0, x1 = states[row, :3], states[row + 1, :3]
    v0, v1 = states[row, 3:], states[row + 1, 3:]
    position = (
        x0
        + h * s * v0
        + s**2 * (3 * (x1 - x0) - h * (2 * v0 + v1))
        + s**3 * (2 * (x0 - x1) + h * (v0 + v1))
    )
    velocity = (
        v0 + s * (6 * (x1 - x0) / h - 4 * v0 - 2 * v1) + s**2 * (6 * (x0 - x1) / h + 3 * (v0 + v1))
    )
    return np.hstack([position, velocity])


def _with_jumps(
    parts: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Join arcs: the first row of each but the first comes a millisecond late, in km."""
    epochs, states = [parts[0][0]], [parts[0][1]]
    for et, rows in parts[1:]:
        late = rows[:1].copy()
        late[:, :3] += _JUMP_S * late[:, 3:]
        rest = et > et[0] + 2 * _JUMP_S
        epochs += [et[:1] + _JUMP_S, et[rest]]
        states += [late, rows[rest]]
    return np.concatenate(epochs), np.concatenate(states) / 1e3
