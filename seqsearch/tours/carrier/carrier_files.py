"""A carrier's flight as a file: ``carrier.json``, which is read back exactly."""

from pathlib import Path
from typing import Final

import msgspec

from feasibility.errors import InputError
from feasibility.runtime.atomic import write_text
from seqsearch.tours.carrier.records import FORMAT, Carrier

CARRIER: Final = "carrier.json"
"""Name of the file that makes a folder a carrier's."""


def read_carrier(path: Path) -> Carrier:
    """Read a ``carrier.json``.

    Raises
    ------
    InputError
        It is missing, damaged, of another format, or says a flight that makes no sense.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=Carrier)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (msgspec.DecodeError, RecursionError) as error:
        if isinstance(error.__cause__, InputError):
            raise InputError(f"{path}: {error.__cause__}") from None
        raise InputError(f"{path}: not a complete {FORMAT} file ({error})") from None


def write_carrier(carrier: Carrier, path: Path) -> None:
    """Write a ``carrier.json``.

    Raises
    ------
    InputError
        It cannot be written.
    """
    write_text(path, msgspec.json.format(msgspec.json.encode(carrier), indent=1).decode() + "\n")
