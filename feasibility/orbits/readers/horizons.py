"""Osculating elements of JPL Horizons: the lines that are a table with a header."""

import re
from collections.abc import Sequence
from pathlib import Path

from feasibility.errors import InputError


def horizons_table(file: Path, lines: Sequence[str]) -> tuple[list[str], str] | None:
    """Return the table of a Horizons file, with its header, and the body's name.

    None of a file that is not by Horizons.

    Raises
    ------
    InputError
        It has no elements as comma-separated values, or not in AU, days and degrees.
    """
    places = {
        mark: i for i, line in enumerate(lines) for mark in ("$$SOE", "$$EOE") if mark in line
    }
    if "$$SOE" not in places:
        return None
    begin, end = places["$$SOE"], places.get("$$EOE", len(lines))
    if end <= begin:
        raise InputError(f"{file}, line {end + 1}: $$EOE before $$SOE, expected it behind")
    header = next((line for line in reversed(lines[:begin]) if line.strip("* ")), "")
    units = next((line for line in lines if line.startswith("Output units")), "AU-D")
    if "JDTDB" not in header or "," not in header:
        raise InputError(
            f"{file}: a Horizons file without elements as a table; expected ephemeris type "
            "ELEMENTS with CSV_FORMAT=YES"
        )
    if "AU-D" not in units or "deg" not in units + "deg":
        raise InputError(f"{file}: {units.strip()}; expected AU-D, deg")
    if end - begin > 2:
        raise InputError(
            f"{file}: {end - begin - 1} epochs of one body; expected one, all bodies in one table"
        )
    target = next((line for line in lines if line.startswith("Target body name")), ":")
    name = re.sub(r"\{.*", "", target.partition(":")[2]).strip()
    # The lines keep their numbers for messages.
    kept = [""] * len(lines[:end])
    kept[begin] = header.strip().rstrip(",")
    kept[begin + 1 : end] = lines[begin + 1 : end]
    return kept, name
