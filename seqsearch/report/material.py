"""`Material`: what a run folder has to tell, read and checked."""

import csv
import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

from feasibility.errors import InputError
from seqsearch.runs.flights import flight_of, tour_file
from seqsearch.runs.run_folder import AUDIT, CANDIDATES, CONFIG, COUNTERS, PROVENANCE
from seqsearch.tours.export.as_flown import as_flown
from seqsearch.tours.export.protocol import Flight
from seqsearch.tours.paths import impulsive_trajectory
from seqsearch.tours.tour import Tour
from seqsearch.tours.tour_files import read_tour

_COUNTS: Final = ("pass_number", "rank", "proposed", "optimised", "feasible", "kept")
_MOST_CANDIDATES: Final = 6000
"""Points of the map: more are a blot, and megabytes."""


@final
@dataclass(frozen=True, kw_only=True)
class RankLine:
    """What happened at one rank: a row of ``counters.csv``."""

    pass_number: int
    rank: int
    proposed: int
    pruned: int
    optimised: int
    feasible: int
    kept: int


@final
@dataclass(frozen=True, kw_only=True)
class CandidateLine:
    """One audited candidate: a row of ``candidates.csv``; `margin` None where it is unknown."""

    kept: bool
    tof_days: float
    margin: float | None
    flyable: bool


@final
@dataclass(frozen=True, kw_only=True)
class Material:
    """What the page is made of.

    Attributes
    ----------
    tour : Tour
        The best tour, with the epochs and masses of the rows.
    note : str
        Why the rows beside the tour were not used; empty where there are none, or they were.
    flight : Flight or None
        With its rows; None where it has no leg yet.
    ranks : tuple of RankLine
        One a rank of each pass; empty where there are no counters.
    candidates : tuple of CandidateLine
        A sample; empty without an audit.
    audit : dict
        ``audit.json`` as it is; empty where there is none.
    config : str
        ``config.toml`` as it is.
    provenance : dict
        ``provenance.json`` as it is.
    """

    tour: Tour
    flight: Flight | None
    note: str
    ranks: tuple[RankLine, ...]
    candidates: tuple[CandidateLine, ...]
    audit: dict[str, Any]
    config: str
    provenance: dict[str, Any]


def gather(path: Path) -> Material:
    """Read a run folder, or a tour file alone.

    Raises
    ------
    InputError
        No tour, a fleet's folder, or a file that is damaged.
    """
    tour = read_tour(tour_file(path))
    flight, note = _flight(path, tour)
    # A tour file of its own says nothing of a search, whatever lies beside it.
    folder = path if path.is_dir() else None
    return Material(
        tour=tour if flight is None else as_flown(flight),
        flight=flight,
        note=note,
        ranks=tuple(_ranks(folder)),
        candidates=_thinned(list(_candidates(folder))),
        audit=_json(folder, AUDIT),
        config=_text(folder, CONFIG),
        provenance=_json(folder, PROVENANCE),
    )


def _flight(path: Path, tour: Tour) -> tuple[Flight | None, str]:
    """Return the flight of a tour and a note; the page shows impulses where rows are stale."""
    if not tour.legs:
        return None, ""
    try:
        return flight_of(path), ""
    except InputError as error:
        return Flight(tour, impulsive_trajectory(tour)), str(error)


def _text(folder: Path | None, name: str) -> str:
    """Return the text of a file; empty where there is none."""
    if folder is None or not (folder / name).is_file():
        return ""
    try:
        return (folder / name).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{folder / name}: cannot be read ({error})") from None


def _json(folder: Path | None, name: str) -> dict[str, Any]:
    text = _text(folder, name)
    if not text:
        return {}
    try:
        record = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{folder}/{name}: no JSON ({error})") from None
    if not isinstance(record, dict):
        raise InputError(f"{folder}/{name}: expected a JSON object")
    return record


def _rows(folder: Path | None, name: str) -> Iterable[tuple[str, dict[str, str]]]:
    """Yield the rows of a CSV file, each with what messages about it begin with."""
    try:
        for number, row in enumerate(csv.DictReader(_text(folder, name).splitlines()), 2):
            yield f"{folder}/{name}, line {number}", row
    except csv.Error as error:
        raise InputError(f"{folder}/{name}: no CSV ({error})") from None


def _ranks(folder: Path | None) -> Iterable[RankLine]:
    for label, row in _rows(folder, COUNTERS):
        try:
            pruned = [key for key in row if key and key.startswith("pruned_")]
            yield RankLine(
                **{name: int(row[name]) for name in _COUNTS},
                pruned=sum(int(row[key]) for key in pruned),
            )
        except (KeyError, ValueError, TypeError):
            raise InputError(
                f"{label}: expected whole numbers {', '.join(_COUNTS)} and pruned_*"
            ) from None


def _candidates(folder: Path | None) -> Iterable[CandidateLine]:
    for label, row in _rows(folder, CANDIDATES):
        try:
            line = CandidateLine(
                kept=bool(int(row["kept"])),
                tof_days=float(row["tof_days"]),
                margin=float(row["predicted_margin"]) if row["predicted_margin"] else None,
                flyable=bool(int(row["flyable"])),
            )
        except (KeyError, ValueError, TypeError):
            raise InputError(
                f"{label}: expected numbers kept, tof_days, predicted_margin, flyable"
            ) from None
        if not all(math.isfinite(value) for value in (line.tof_days, line.margin or 0.0)):
            raise InputError(f"{label}: a number that is not finite")
        yield line


def _thinned(lines: list[CandidateLine]) -> tuple[CandidateLine, ...]:
    """Return evenly spread lines, at most as many as a map can show; the lost ones all."""
    step = -(-len(lines) // _MOST_CANDIDATES) or 1
    return tuple(
        line for k, line in enumerate(lines) if k % step == 0 or (line.flyable and not line.kept)
    )
