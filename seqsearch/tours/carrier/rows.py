"""Writes the files to hand in of a carrier and its craft: ``M.TXT``, ``P1.TXT`` and so on.

``M.TXT`` has a line for each event, with the state and the mass after it::

    MJD x y z vx vy vz m EVENT      km, km/s, kg

Events are ``LAUNCH``, ``DV``, ``RELEASE P1`` and ``CAPTURE P1``. The file of a craft has the
``rows`` format, in which the carrier is called ``MOTHER``.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import msgspec

from feasibility.constants import MJD2000_MJD
from feasibility.errors import InputError
from feasibility.runtime.atomic import write_text
from seqsearch.tours.carrier.path import fly_carrier
from seqsearch.tours.carrier.records import (
    Carrier,
    CarrierEvent,
    CarrierImpulse,
    CarrierLaunch,
    CraftCapture,
    CraftRelease,
)
from seqsearch.tours.export.rows import write_rows
from seqsearch.tours.trajectory import Phase, Trajectory

MOTHER: Final = "MOTHER"
"""What rows call the carrier."""

_DIGITS: Final = 13
"""Of the rows of craft: some centimetres, in two thirds of the bytes of all digits."""


def write_carrier_rows(folder: Path, carrier: Carrier, craft: Mapping[int, Trajectory]) -> Carrier:
    """Write the files of a carrier and its craft into a folder.

    Parameters
    ----------
    folder : Path
        Where they go; it is there already.
    carrier : Carrier
        The flight; releases and captures are moved to where the rows of the craft begin and end.
    craft : mapping of int to Trajectory
        For each craft that is released, the rows of its tour, which begins and ends at the
        carrier whatever the tour calls it.

    Returns
    -------
    Carrier
        The flight that was written.

    Raises
    ------
    InputError
        A craft that is released has no rows, or ones that are not of continuous thrust, or rows
        are there for one that is not; or a file cannot be written.
    """
    docked = docked_carrier(carrier, craft)
    for number, trajectory in craft.items():
        if not trajectory.continuous:
            raise InputError(f"P{number}: impulses, expected continuous thrust; refine it first")
        write_rows(
            named_at_carrier(trajectory),
            folder / f"P{number}.TXT",
            title=f"craft {number}",
            digits=_DIGITS,
        )
    write_text(folder / "M.TXT", _log(docked))
    return docked


def docked_carrier(carrier: Carrier, craft: Mapping[int, Trajectory]) -> Carrier:
    """Return a carrier with its releases and captures where the rows of its craft have them.

    Raises
    ------
    InputError
        A craft is released and has no rows, or the other way round.
    """
    released = {event.craft for event in carrier.events if isinstance(event, CraftRelease)}
    if released != set(craft):
        raise InputError(
            f"carrier: releases craft {sorted(released)}, expected those that have rows, "
            f"{sorted(craft)}"
        )
    events = [_docked(event, craft) for event in carrier.events]
    # Events of one epoch stay in their order.
    ordered = sorted(events, key=lambda event: event.t_mjd2000)
    return msgspec.structs.replace(carrier, events=tuple(ordered))


def _docked(event: CarrierEvent, craft: Mapping[int, Trajectory]) -> CarrierEvent:
    match event:
        case CraftRelease(craft=number):
            begin = float(craft[number].phases[0].t_mjd2000[0])
            return msgspec.structs.replace(event, t_mjd2000=begin)
        case CraftCapture(craft=number):
            last = craft[number].phases[-1]
            end, mass = float(last.t_mjd2000[-1]), float(last.mass_kg[-1])
            return msgspec.structs.replace(event, t_mjd2000=end, mass_kg=mass)
    return event


def named_at_carrier(trajectory: Trajectory) -> Trajectory:
    """Return a trajectory whose ends have the carrier's name."""
    phases = list(trajectory.phases)
    phases[0] = _renamed(phases[0], MOTHER, phases[0].end)
    phases[-1] = _renamed(phases[-1], phases[-1].start, MOTHER)
    return replace(trajectory, phases=tuple(phases))


def _renamed(phase: Phase, start: str, end: str) -> Phase:
    return Phase(start, end, phase.t_mjd2000, phase.states, phase.mass_kg, phase.thrust_n)


def _log(carrier: Carrier) -> str:
    path = fly_carrier(carrier)
    lines = [
        f"# {carrier.rules.name}\n# MJD x y z vx vy vz m EVENT, after each event; km, km/s, kg; "
        "heliocentric ecliptic J2000"
    ]
    for event, state, mass in zip(carrier.events, path.after, path.mass_kg, strict=True):
        numbers = " ".join(f"{value:.16e}" for value in (*(state / 1e3), mass))
        lines.append(f"{event.t_mjd2000 + MJD2000_MJD:.17g} {numbers} {event_label(event)}")
    return "\n".join(lines) + "\n"


def event_label(event: CarrierEvent) -> str:
    """Return what ``M.TXT`` calls an event."""
    match event:
        case CarrierLaunch():
            return "LAUNCH"
        case CarrierImpulse():
            return "DV"
        case CraftRelease(craft=number):
            return f"RELEASE P{number}"
        case CraftCapture(craft=number):
            return f"CAPTURE P{number}"
