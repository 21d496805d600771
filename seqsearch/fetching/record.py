"""What was fetched, from where and when: a small file beside each fetched one."""

import hashlib
from pathlib import Path
from typing import Final, final

import msgspec

from feasibility.errors import InputError
from feasibility.runtime.atomic import write_json

_SUFFIX: Final = ".source.json"


@final
class FetchRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Where a file comes from.

    Attributes
    ----------
    url : str
        What was asked, with all parameters.
    fetched : str
        When, in UTC.
    sha256 : str
        Of the file's content.
    size_bytes : int
        Its length.
    what : str
        In words.
    """

    url: str
    fetched: str
    sha256: str
    size_bytes: int
    what: str


def record_path(file: Path) -> Path:
    """Return where the record of a file is."""
    return file.with_name(file.name + _SUFFIX)


def read_record(file: Path) -> FetchRecord | None:
    """Return the record of a file; None where there is none that can be read."""
    try:
        return msgspec.json.decode(record_path(file).read_bytes(), type=FetchRecord)
    except (OSError, msgspec.DecodeError):
        return None


def write_record(file: Path, record: FetchRecord) -> None:
    """Write the record of a file.

    Raises
    ------
    InputError
        It cannot be written.
    """
    write_json(record_path(file), msgspec.structs.asdict(record))


def sha256_of(file: Path) -> str:
    """Return the SHA-256 of a file.

    Raises
    ------
    InputError
        It cannot be read.
    """
    try:
        with file.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
