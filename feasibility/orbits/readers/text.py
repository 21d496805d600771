"""The lines of a table, whatever it is packed in and however its letters are encoded."""

import codecs
import gzip
import io
import re
import warnings
import zlib
from pathlib import Path
from typing import Final

from feasibility.errors import InputError

_MAX_BYTES: Final = 1 << 29
"""Of an unpacked table: all known minor planets take 300 MB."""

_PACKED: Final = {b"PK\x03\x04": "a zip archive", b"BZh": "packed by bzip2", b"\xfd7zXZ": "an xz"}
_UTF_16: Final = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_NOT_TEXT: Final = re.compile(r"[\x00-\x08\x0e-\x1b]")


def read_lines(file: Path) -> list[str]:
    """Return the lines of a table, any line ends, of UTF-8, UTF-16 or cp1252, also gzipped.

    Letters that are no UTF-8 are read as cp1252, with a warning: only names have them.

    Raises
    ------
    InputError
        The file cannot be read, is empty, too large or no text.
    """
    data = _unpacked(file)
    text = _decoded(file, data)
    control = _NOT_TEXT.search(text)
    if control is not None:
        number = len(re.split(r"\r\n|\r|\n", text[: control.start()]))
        raise InputError(
            f"{file}, line {number}: byte 0x{ord(control[0]):02x} is no text; "
            "expected an asteroid table as plain text"
        )
    if not text.strip():
        raise InputError(f"{file}: the file is empty; expected an asteroid table")
    return re.split(r"\r\n|\r|\n", text)


def _unpacked(file: Path) -> bytes:
    try:
        data = file.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{file}: no such file; expected an asteroid table") from None
    except IsADirectoryError:
        raise InputError(f"{file}: is a folder; expected an asteroid table") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    for magic, what in _PACKED.items():
        if data.startswith(magic):
            raise InputError(f"{file}: is {what}; expected plain text, or text packed by gzip")
    if not data.startswith(b"\x1f\x8b"):
        return data
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as packed:
            data = packed.read(_MAX_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{file}: is damaged gzip ({error})") from None
    if len(data) > _MAX_BYTES:
        raise InputError(f"{file}: unpacks to more than {_MAX_BYTES >> 20} MiB")
    return data


def _decoded(file: Path, data: bytes) -> str:
    try:
        if data.startswith(_UTF_16):
            return data.decode("utf-16")
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        number = len(re.split(rb"\r\n|\r|\n", data[: error.start]))
    warnings.warn(
        f"{file}, line {number}: is not UTF-8; names are read as cp1252 (Latin-1)", stacklevel=5
    )
    # Five bytes mean nothing in cp1252; they are replaced.
    return data.removeprefix(codecs.BOM_UTF8).decode("cp1252", "replace")
