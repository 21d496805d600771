"""The Minor Planet Center's extended JSON, ``mpcorb_extended.json`` or ``nea_extended.json``.

A list of objects, one a body; described in
<https://minorplanetcenter.net/Extended_Files/Extended_MPCORB_Data_Format_Manual.pdf>.
"""

import re
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from feasibility.errors import InputError
from feasibility.orbits.readers.bodies import UNNUMBERED, BodyTable, sieved
from feasibility.orbits.readers.columns import NEEDED
from feasibility.orbits.readers.json_text import (
    EXPECTED,
    decoded,
    further_column,
    mjd_column,
    number_column,
)

LABEL: Final = "MPC extended JSON"


class _Body(msgspec.Struct, gc=False):
    """The members that are read; all may be absent."""

    Number: Any = None
    Name: Any = None
    Principal_desig: Any = None
    Epoch: Any = None
    M: Any = None
    Peri: Any = None
    Node: Any = None
    i: Any = None
    e: Any = None
    a: Any = None
    H: Any = None
    G: Any = None
    U: Any = None
    Num_obs: Any = None
    Num_opps: Any = None
    NEO_flag: Any = None
    PHA_flag: Any = None


_MEMBERS: Final = dict(zip(NEEDED, ("Epoch", "a", "e", "i", "Node", "Peri", "M"), strict=True))
_EXTRA: Final = {"H": "H", "G": "G", "U": "U", "n_obs": "Num_obs", "n_opp": "Num_opps"}
_FLAGS: Final = {"neo": "NEO_flag", "pha": "PHA_flag"}


def mpc_json_bodies(file: Path, data: bytes) -> BodyTable:
    """Return the bodies of a list in this format; ids are as in `mpcorb_bodies`.

    Raises
    ------
    InputError
        It is not such a list, a member is no number, or as `sieved`.
    """
    bodies: list[_Body] = decoded(file, data, list[_Body])
    if not any(body.Epoch is not None and body.Peri is not None for body in bodies):
        raise InputError(f"{file}: is JSON without members Epoch and Peri; expected {EXPECTED}")
    numbers = np.array([_number(body) for body in bodies], np.int64)
    names = [_name(body, number) for body, number in zip(bodies, numbers.tolist(), strict=True)]
    unnumbered = np.arange(1, len(bodies) + 1)
    if (numbers >= 0).any():
        unnumbered += UNNUMBERED

    def place(row: int) -> str:
        return f"body {row + 1} ({names[row]})"

    orbits = np.column_stack(
        [
            number_column(file, member, [getattr(body, member) for body in bodies], place)
            for member in _MEMBERS.values()
        ]
    )
    orbits[:, 0] = mjd_column(file, "Epoch", orbits[:, 0], place)
    extra = {
        name: further_column([getattr(body, member) for body in bodies])
        for name, member in _EXTRA.items()
    }
    # A flag that is not there is not set.
    extra |= {
        name: np.nan_to_num(further_column([getattr(body, member) for body in bodies]))
        for name, member in _FLAGS.items()
    }
    return sieved(
        file, LABEL, np.where(numbers >= 0, numbers, unnumbered), names, orbits, extra, place
    )


def _number(body: _Body) -> int:
    found = re.fullmatch(r"\(?(\d{1,15})\)?", str(body.Number).strip())
    return -1 if found is None else int(found[1])


def _name(body: _Body, number: int) -> str:
    name = next((str(text) for text in (body.Name, body.Principal_desig) if text), "")
    return " ".join(part for part in (str(number) if number >= 0 else "", name) if part) or "?"
