"""`read_kernels`: a catalogue of the bodies of SPK kernels, on Kepler orbits or as they move."""

import hashlib
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Final, Literal, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S, MJD2000_MJD, YEAR_DAYS
from feasibility.errors import InputError
from feasibility.orbits.catalogue import Catalogue
from feasibility.orbits.classical import cartesian_to_classical
from feasibility.orbits.spk.chebyshev import Fit, fit
from feasibility.orbits.spk.coverage import (
    BodyCoverage,
    Interval,
    around,
    coverage,
    nearest,
    within,
)
from feasibility.orbits.spk.dates import Calendar, mjd2000_of, seconds_of
from feasibility.orbits.spk.files import kernel_files
from feasibility.orbits.spk.kepler_error import ERROR_KM, ERROR_M_S, kepler_error
from feasibility.orbits.spk.kernel_table import KernelSource, KernelTable
from feasibility.orbits.spk.motion import Motion, Piece, States, states_at
from feasibility.orbits.spk.names import chosen_bodies, name_of
from feasibility.orbits.spk.segments import read_segments

_Array = NDArray[np.float64]

EphemerisKind = Literal["kepler", "spk"]

_MARGIN_S: Final = 60 * DAY_S
"""A search rounds epochs to buckets and looks beyond the window's ends by as much."""

_HALF_SPAN_S: Final = 5 * YEAR_DAYS * DAY_S
_WORST_M: Final = 1.0


@final
@dataclass(frozen=True, eq=False)
class _Body:
    """What was found of one body; `span` is from the first to the last covered epoch."""

    number: int
    epoch: float
    elements: _Array
    error: tuple[float, float]
    span: Interval
    fit: Fit | None
    pieces: tuple[Piece, ...]


@final
@dataclass(frozen=True, eq=False)
class KernelReading:
    """What was read from kernels.

    Attributes
    ----------
    catalogue : Catalogue
        The bodies.
    away : tuple of str
        Bodies that are left out, as they are on no ellipse about the Sun.
    notes : tuple of str
        What users should know.
    """

    catalogue: Catalogue
    away: tuple[str, ...]
    notes: tuple[str, ...]


def read_kernels(
    path: str | PathLike[str],
    bodies: Sequence[int | str] = (),
    ephemeris: EphemerisKind = "kepler",
    window_mjd2000: tuple[float, float] | None = None,
) -> Catalogue:
    """Read the bodies of an SPK kernel, a folder of kernels or a meta-kernel.

    Elements osculate at the middle of the window, or of what the kernels cover, or at the
    nearest epoch that they cover. `extra` has how far the Kepler orbits are off (see
    `kepler_error`) and the coverage, ``covered_from_mjd`` and ``covered_to_mjd``.

    Parameters
    ----------
    path : path-like
        Kernels.
    bodies : sequence of int or str
        NAIF numbers, numbers of asteroids or names; default: all small bodies and spacecraft.
    ephemeris : str
        ``"kepler"``, or ``"spk"`` for a catalogue that moves the bodies as the kernels say,
        which needs a window.
    window_mjd2000 : tuple of float, optional
        First and last epoch of the mission.

    Returns
    -------
    Catalogue
        Ids are NAIF numbers.

    Raises
    ------
    InputError
        A kernel cannot be used, a body is not there, its motion about the Sun is not known, or
        the kernels do not cover the window: all of it for ``"spk"``, some of it for ``"kepler"``.
        The message is one line that names file, body, coverage and window.
    """
    reading = kernel_reading(path, bodies, ephemeris, window_mjd2000)
    for note in reading.notes:
        warnings.warn(f"{path}: {note}", stacklevel=2)
    if reading.away:
        warnings.warn(f"{path}: {_left_out(reading)}", stacklevel=2)
    return reading.catalogue


def _left_out(reading: KernelReading) -> str:
    away = reading.away
    return (
        f"{len(away)} of {len(reading.catalogue) + len(away)} bodies are on no ellipse about the "
        f"Sun and are left out: {', '.join(away[:3])}{' ...' if len(away) > 3 else ''}"
    )


def kernel_reading(
    path: str | PathLike[str],
    bodies: Sequence[int | str] = (),
    ephemeris: EphemerisKind = "kepler",
    window_mjd2000: tuple[float, float] | None = None,
) -> KernelReading:
    """Return what `read_kernels` does, with what it has to say of it.

    Parameters
    ----------
    path, bodies, ephemeris, window_mjd2000
        As for `read_kernels`.

    Raises
    ------
    InputError
        As for `read_kernels`.
    """
    if ephemeris == "spk" and window_mjd2000 is None:
        raise InputError(f'{path}: ephemeris = "spk" needs the window of a mission')
    files = kernel_files(Path(path))
    motion = Motion(read_segments(files.spk))
    calendar = Calendar.read(files.leap_seconds)
    window = None if window_mjd2000 is None else _window(window_mjd2000)
    found: list[_Body] = []
    away: list[str] = []
    notes: list[str] = []
    with motion.reading() as states:
        for number in chosen_bodies(files.path, bodies, motion.bodies):
            pieces = motion.pieces(number)
            label = _label(number)
            if not pieces:
                raise InputError(f"{files.path}: {label} {motion.missing(number)}")
            covered = BodyCoverage(
                files.path, label, motion.files_of(number), tuple(coverage(pieces)), calendar
            )
            body = _read_body(number, pieces, covered, states, window, ephemeris)
            if window is not None and ephemeris == "kepler":
                notes += covered.needs_some_of(window)
            if body is None:
                away.append(label)
            else:
                found.append(body)
    if not found:
        raise InputError(
            f"{files.path}: {', '.join(away[:3])}: on no ellipse about the Sun, expected a body "
            "that is"
        )
    notes += [
        f"{_label(body.number)} has jumps in its kernel; its table is off by up to "
        f"{body.fit.worst_m:.3g} m there"
        for body in found
        if body.fit is not None and body.fit.worst_m > _WORST_M
    ]
    return KernelReading(_catalogue(files.path, found, ephemeris), tuple(away), tuple(notes))


def _window(window_mjd2000: tuple[float, float]) -> Interval:
    return seconds_of(window_mjd2000[0]), seconds_of(window_mjd2000[1])


def _label(number: int) -> str:
    name = name_of(number)
    return f"body {number}" if name == str(number) else f"body {number} {name}"


def _read_body(
    number: int,
    pieces: Sequence[Piece],
    covered: BodyCoverage,
    states: States,
    window: Interval | None,
    ephemeris: EphemerisKind,
) -> _Body | None:
    """Return what is found of a body, None where it is on no ellipse about the Sun."""
    intervals = covered.intervals
    if window is not None and ephemeris == "spk":
        covered.needs_all_of(window)
    elif window is not None:
        covered.needs_some_of(window)
    span = (intervals[0][0], intervals[-1][1]) if window is None else window
    epoch = nearest(intervals, (span[0] + span[1]) / 2.0)
    if window is None:
        span = (epoch - _HALF_SPAN_S, epoch + _HALF_SPAN_S)
    state = states_at(pieces, states, np.array([epoch]))
    try:
        elements = cartesian_to_classical(state)[0]
    except InputError:
        return None
    error = kepler_error(pieces, states, within(intervals, span), epoch, state)
    whole = (intervals[0][0], intervals[-1][1])
    table: Fit | None = None
    used: tuple[Piece, ...] = ()
    if window is not None and ephemeris == "spk":
        around_it = around(intervals, window)
        assert around_it is not None
        start = max(around_it[0], window[0] - _MARGIN_S)
        end = min(around_it[1], window[1] + _MARGIN_S)
        used = tuple(piece for piece in pieces if piece.end > start and piece.start < end)
        table = _table(used, states, (start, end))
    return _Body(number, epoch, elements, error, whole, table, used)


def _table(pieces: Sequence[Piece], states: States, span: Interval) -> Fit:
    """Return polynomials that follow a body over a span, anew from each segment to the next."""
    fits = []
    for piece in pieces:
        start, end = max(piece.start, span[0]), min(piece.end, span[1])
        if end > start:
            fits.append(fit(partial(states, piece), start, end))
    return Fit(
        np.concatenate([part.start for part in fits]),
        np.concatenate([part.end for part in fits]),
        np.concatenate([part.coefficients for part in fits]),
        max(part.worst_m for part in fits),
    )


def _catalogue(path: Path, bodies: Sequence[_Body], ephemeris: EphemerisKind) -> Catalogue:
    errors = np.array([body.error for body in bodies])
    spans = mjd2000_of(np.array([body.span for body in bodies])) + MJD2000_MJD
    return Catalogue(
        ids=[body.number for body in bodies],
        names=[name_of(body.number) for body in bodies],
        epoch_mjd2000=[mjd2000_of(body.epoch) for body in bodies],
        elements=[body.elements for body in bodies],
        source=str(path),
        extra={
            ERROR_KM: errors[:, 0] / 1e3,
            ERROR_M_S: errors[:, 1],
            "covered_from_mjd": spans[:, 0],
            "covered_to_mjd": spans[:, 1],
        },
        ephemeris=_joined(bodies) if ephemeris == "spk" else None,
    )


def _joined(bodies: Sequence[_Body]) -> KernelTable:
    fits = [body.fit for body in bodies if body.fit is not None]
    counts = [len(part.start) for part in fits]
    files = {
        segment.file: None
        for body in bodies
        for piece in body.pieces
        for segment, _ in piece.links
    }
    return KernelTable(
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        mjd2000_of(np.concatenate([part.start for part in fits])),
        mjd2000_of(np.concatenate([part.end for part in fits])),
        np.concatenate([part.coefficients for part in fits]),
        tuple(KernelSource(file.name, _sha256(file)) for file in files),
    )


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
