"""JPL's Horizons: SPK kernels of single bodies over a span of time."""

import base64
import binascii
import re
from pathlib import Path
from typing import Final

from feasibility.errors import InputError
from seqsearch.fetching.contents import read_answer
from seqsearch.fetching.download import UnfitError, Wanted
from seqsearch.fetching.services import HORIZONS, address_of

_EXPECTED: Final = "an SPK kernel in JSON"
_FIRST_NAIF: Final = 1_000_000
"""Numbers from here on are NAIF's; below they are those of asteroids."""


def horizons_spk(
    body: str,
    target: Path,
    *,
    start: str,
    stop: str,
    url: str | None = None,
    sha256: str | None = None,
) -> Wanted:
    """Return what to fetch: the kernel of one small body.

    Parameters
    ----------
    body : str
        Number of an asteroid, NAIF number, name or designation.
    target : Path
        The kernel.
    start, stop : str
        Dates such as ``2030-01-01``.
    url, sha256 : str, optional
        As for `Wanted`.

    Raises
    ------
    InputError
        The dates are not in order.
    """
    if start >= stop:
        raise InputError(f"--start {start} --stop {stop}: expected the start before the stop")
    return Wanted(
        url=address_of(HORIZONS, "horizons", url),
        parameters={
            "format": "json",
            "EPHEM_TYPE": "SPK",
            "OBJ_DATA": "NO",
            "COMMAND": f"'{_command(body)}'",
            "START_TIME": f"'{start}'",
            "STOP_TIME": f"'{stop}'",
        },
        target=target,
        what=f"SPK kernel of {body}, {start} to {stop}, of JPL Horizons",
        make=_make,
        sha256=sha256,
    )


def file_name(body: str) -> str:
    """Return the name of a body's kernel."""
    return re.sub(r"[^\w.-]+", "_", body.strip().lower()).strip("_") + ".bsp"


def _command(body: str) -> str:
    """Return how Horizons calls a small body."""
    if "'" in body or ";" in body:
        raise InputError(f"body {body!r}: expected a number, name or designation")
    if body.strip().isdigit() and int(body) >= _FIRST_NAIF:
        return f"DES={body.strip()};"
    return f"{body.strip()};"


def _make(came: Path, file: Path) -> None:
    # Imported here: it loads the readers of kernels.
    from feasibility.orbits.spk.segments import read_segments

    answer = read_answer(came, _EXPECTED)
    packed = answer.get("spk")
    if not packed:
        raise UnfitError(f"sends no kernel{_reason(answer)}")
    try:
        content = base64.b64decode("".join(str(packed).split()), validate=True)
    except (binascii.Error, ValueError):
        raise UnfitError(f"sends a kernel that is cut off, expected {_EXPECTED}") from None
    if not content.startswith(b"DAF/SPK"):
        raise UnfitError(f"sends something else than a kernel, expected {_EXPECTED}")
    file.write_bytes(content)
    try:
        read_segments([file])
    except InputError as error:
        raise UnfitError(
            f"sends a kernel that is {str(error).removeprefix(f'{file}: ')}"
        ) from None


def _reason(answer: dict[str, object]) -> str:
    """Return what Horizons says, its frame of asterisks and version aside."""
    text = str(answer.get("error") or answer.get("message") or answer.get("result") or "")
    lines = [line.strip() for line in text.splitlines() if line.strip(" *-")]
    lines = [line for line in lines if not line.startswith("API ")]
    return f": {' '.join(' '.join(lines).split())[:200]}" if lines else ""
