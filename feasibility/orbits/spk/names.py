"""Bodies of kernels by number or name."""

import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from feasibility.errors import InputError
from feasibility.runtime.spice import spice

_FIRST_SMALL: Final = 1_000_000
"""NAIF numbers from here on are comets and asteroids; below are planets and satellites."""

_ASTEROIDS: Final = (2_000_000, 20_000_000)
"""What NAIF adds to the number of an asteroid: in older kernels, and in newer ones."""

_MOST_NAMED: Final = 12


def chosen_bodies(
    path: Path, wanted: Sequence[int | str], present: Sequence[int]
) -> tuple[int, ...]:
    """Return the NAIF numbers of the bodies that were asked for.

    Parameters
    ----------
    path : Path
        What the messages begin with.
    wanted : sequence of int or str
        NAIF numbers, numbers of asteroids or names; all small bodies and spacecraft where it is
        empty.
    present : sequence of int
        NAIF numbers of the bodies of the kernels.

    Raises
    ------
    InputError
        A body is not there, is there twice, or there is no small body or spacecraft.
    """
    if not wanted:
        small = tuple(body for body in present if body < 0 or body >= _FIRST_SMALL)
        if not small:
            raise InputError(
                f"{path}: has no small body and no spacecraft, but {_listed(present)}; say which "
                "bodies with bodies = [...] in [catalogue]"
            )
        return small
    found: list[int] = []
    for body in wanted:
        number = _number(body, present)
        if number is None:
            raise InputError(f"{path}: has no body {body!r}; it has {_listed(present)}")
        if number in found:
            raise InputError(f"{path}: body {body!r} is named twice in bodies")
        found.append(number)
    return tuple(found)


def name_of(body: int) -> str:
    """Return the name that SPICE knows for a NAIF number, else its digits."""
    with spice() as spiceypy:
        # A number below the asteroids' is itself alone: 4 is Mars here, not Vesta.
        for number in _alike(body) if body >= _FIRST_SMALL else (body,):
            with suppress(spiceypy.utils.exceptions.NotFoundError):
                return str(spiceypy.bodc2n(number))
    return str(body)


def _number(body: int | str, present: Sequence[int]) -> int | None:
    if isinstance(body, str) and re.fullmatch(r"\s*-?\d+\s*", body):
        body = int(body)
    if isinstance(body, str):
        with spice() as spiceypy:
            try:
                body = int(spiceypy.bodn2c(body))
            except spiceypy.utils.exceptions.NotFoundError:
                return None
    return next((number for number in _alike(body) if number in present), None)


def _alike(body: int) -> tuple[int, ...]:
    """Return a number and the others that mean the same asteroid."""
    for base in _ASTEROIDS:
        if base < body < base + _FIRST_SMALL:
            return (body, *(other + body - base for other in _ASTEROIDS if other != base))
    if 0 < body < _FIRST_SMALL:
        return (body, *(base + body for base in _ASTEROIDS))
    return (body,)


def _listed(present: Sequence[int]) -> str:
    texts = [
        f"{body} {name}" if (name := name_of(body)) != str(body) else str(body)
        for body in present[:_MOST_NAMED]
    ]
    more = f" and {len(present) - _MOST_NAMED} more" if len(present) > _MOST_NAMED else ""
    return ", ".join(texts) + more
