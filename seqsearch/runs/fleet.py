"""A fleet: several probes whose tours share no asteroid, one run folder a probe."""

import json
from itertools import combinations
from pathlib import Path
from typing import Final

from feasibility import InputError
from feasibility.runtime.atomic import write_json
from feasibility.runtime.provenance import provenance
from seqsearch.runs.run_folder import SEQUENCE
from seqsearch.tours.checks import Check
from seqsearch.tours.tour import Tour

FLEET: Final = "fleet.json"
"""Name of the file that makes a folder a fleet's."""


def probe_folder(number: int) -> str:
    """Return the name of the sub-folder of a probe, numbered from 1."""
    return f"probe-{number}"


def is_fleet(folder: Path) -> bool:
    """Tell whether a folder holds a fleet."""
    return (folder / FLEET).is_file()


def write_fleet(folder: Path, tours: list[Tour], probes: int, seed: int) -> None:
    """Write ``fleet.json``: the asteroids of the probes that are done so far, and their number.

    Raises
    ------
    InputError
        It cannot be written.
    """
    record = {
        "probes": probes,
        "done": [
            {
                "folder": probe_folder(number),
                "asteroids": tour.n_asteroids,
                "duration_days": tour.duration_days,
                "m_final_kg": tour.m_final_kg,
                "ids": [body.id for body in tour.bodies],
            }
            for number, tour in enumerate(tours, 1)
        ],
        "asteroids": sum(tour.n_asteroids for tour in tours),
        "seed": seed,
        "provenance": provenance(),
    }
    write_json(folder / FLEET, record)


def probe_paths(folder: Path) -> list[Path]:
    """Return the tour files of the probes that are done, in their own folders.

    Raises
    ------
    InputError
        ``fleet.json`` is missing or damaged.
    """
    file = folder / FLEET
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
        names = [str(probe["folder"]) for probe in record["done"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{file}: cannot be read as a fleet ({error})") from None
    return [folder / Path(name).name / SEQUENCE for name in names]


def check_disjoint(tours: list[Tour]) -> Check:
    """Check that no body is visited by two probes."""
    bodies = [{body.id for body in tour.visits} for tour in tours]
    shared = sorted(set().union(*(a & b for a, b in combinations(bodies, 2))))
    return Check(
        "no asteroid on two probes", not shared, str(shared) if shared else "none", "none"
    )
