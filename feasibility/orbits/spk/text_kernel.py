r"""Text kernels: the assignments between ``\begindata`` and ``\begintext``.

Layout as in NAIF's "Kernel Required Reading": ``NAME = value``, ``NAME = ( value, value )`` and
``NAME += ...``; texts stand in single quotes, and a text ending in ``+`` goes on in the next.
"""

import re
from pathlib import Path
from typing import Final

from feasibility.errors import InputError

_VALUE: Final = r"'(?:[^']|'')*'|[^\s,()']+"
_ASSIGNMENT: Final = re.compile(
    rf"(?P<name>[^\s=+()']+)\s*(?P<more>\+)?=\s*(?P<values>\([^()]*?(?:'(?:[^']|'')*'[^()']*?)*\)|{_VALUE})"
)
_MOST_BYTES: Final = 10_000_000


def read_text_kernel(path: Path) -> dict[str, list[str]]:
    """Return the values of each variable as text, quotes removed.

    Raises
    ------
    InputError
        The file cannot be read or is no text.
    """
    try:
        with path.open("rb") as file:
            text = file.read(_MOST_BYTES).decode("utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is no text; expected a text kernel of SPICE") from None
    found: dict[str, list[str]] = {}
    blocks = re.findall(r"^\s*\\begindata\s*$(.*?)(?:^\s*\\begintext\s*$|\Z)", text, re.M | re.S)
    for block in blocks:
        for match in _ASSIGNMENT.finditer(block):
            values = [_plain(value) for value in re.findall(_VALUE, match["values"])]
            if match["more"] is None:
                found[match["name"]] = []
            found.setdefault(match["name"], []).extend(values)
    return found


def joined(values: list[str]) -> list[str]:
    """Return texts with those that go on in the next one put together."""
    texts: list[str] = []
    goes_on = False
    for value in values:
        part = value.rstrip()
        more = part.endswith("+")
        part = part[:-1] if more else value.strip()
        texts = [*texts[:-1], texts[-1] + part] if goes_on else [*texts, part]
        goes_on = more
    return texts


def _plain(value: str) -> str:
    return value[1:-1].replace("''", "'") if value.startswith("'") else value
