"""The bytes and lines of a table, whatever it is packed in and however its letters are encoded."""

import codecs
import gzip
import io
import re
import zlib
from pathlib import Path
from typing import Final

from feasibility.errors import InputError

_MAX_BYTES: Final = 1 << 31
"""Of an unpacked table: all known minor planets take 300 MB, as JSON 1.4 GB."""

_PACKED: Final = {b"PK\x03\x04": "a zip archive", b"BZh": "packed by bzip2", b"\xfd7zXZ": "an xz"}
_UTF_16: Final = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_NOT_TEXT: Final = re.compile(r"[\x00-\x08\x0e-\x1b]")


def read_bytes(file: Path) -> bytes:
    """Return a file as it is on disk.

    Raises
    ------
    InputError
        It cannot be read.
    """
    try:
        return file.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{file}: no such file; expected an asteroid table") from None
    except IsADirectoryError:
        raise InputError(f"{file}: is a folder; expected an asteroid table") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None


def unpacked(file: Path, data: bytes) -> bytes:
    """Return what a file holds, unpacked where gzip packed it, with the line ends of Unix.

    Raises
    ------
    InputError
        It is packed by something else, damaged, too large or empty.
    """
    for magic, what in _PACKED.items():
        if data.startswith(magic):
            raise InputError(f"{file}: is {what}; expected plain text, or text packed by gzip")
    if data.startswith(b"\x1f\x8b"):
        try:
            with gzip.GzipFile(fileobj=io.BytesIO(data)) as packed:
                data = packed.read(_MAX_BYTES + 1)
        except (OSError, EOFError, zlib.error) as error:
            raise InputError(f"{file}: is damaged gzip ({error})") from None
        if len(data) > _MAX_BYTES:
            raise InputError(f"{file}: unpacks to more than {_MAX_BYTES >> 20} MiB")
    if data.startswith(_UTF_16):
        try:
            data = data.decode("utf-16").encode("utf-8")
        except UnicodeError:
            raise InputError(f"{file}: is damaged UTF-16; expected an asteroid table") from None
    data = data.removeprefix(codecs.BOM_UTF8)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if not data.strip():
        raise InputError(f"{file}: the file is empty; expected an asteroid table")
    return data


def text_lines(file: Path, data: bytes) -> tuple[list[str], tuple[str, ...]]:
    """Return the lines of a table of UTF-8 or cp1252, and notes about the encoding.

    Letters that are no UTF-8 are read as cp1252: only names have them.

    Raises
    ------
    InputError
        The file is no text.
    """
    notes: tuple[str, ...] = ()
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        number = data.count(b"\n", 0, error.start) + 1
        notes = (f", line {number}: is not UTF-8; names are read as cp1252 (Latin-1)",)
        # Five bytes mean nothing in cp1252; they are replaced.
        text = data.decode("cp1252", "replace")
    control = _NOT_TEXT.search(text)
    if control is not None:
        number = text.count("\n", 0, control.start()) + 1
        raise InputError(
            f"{file}, line {number}: byte 0x{ord(control[0]):02x} is no text; "
            "expected an asteroid table as plain text"
        )
    return text.split("\n"), notes
