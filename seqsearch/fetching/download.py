"""`fetch`: a file from a service, complete or not at all."""

import datetime
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, final
from urllib.parse import urlsplit

import msgspec
import requests
import urllib3
from tqdm import tqdm

from feasibility.errors import InputError
from feasibility.runtime.atomic import atomic_path
from feasibility.runtime.folders import make_folder
from seqsearch.fetching.record import (
    FetchRecord,
    read_record,
    record_path,
    sha256_of,
    write_record,
)
from seqsearch.fetching.session import TIMEOUT, check_status, in_words, new_session

_BLOCK: Final = 1 << 18
_LONGEST_PAUSE_S: Final = 30.0


class UnfitError(ValueError):
    """An answer is not what was asked for; the message says what it is, and what was expected."""


Make = Callable[[Path, Path], None]
"""Makes the file (second) from what came (first), or raises `UnfitError`."""


@final
@dataclass(frozen=True)
class Wanted:
    """What to fetch, and where to.

    Parameters
    ----------
    url : str
        The service's address.
    parameters : dict
        Its query.
    target : Path
        The file.
    what : str
        In words, for the record and messages.
    make : callable
        Checks what came, and makes the file from it.
    resumable : bool
        Whether the service has a file, of which the rest can be asked for, rather than answers
        anew each time.
    sha256 : str, optional
        What the file's SHA-256 has to be.
    """

    url: str
    target: Path
    what: str
    make: Make
    parameters: dict[str, str] = field(default_factory=dict)
    resumable: bool = False
    sha256: str | None = None

    @property
    def address(self) -> str:
        """The address with its query.

        Raises
        ------
        InputError
            It is none.
        """
        with in_words(self.url):
            return str(requests.Request("GET", self.url, params=self.parameters).prepare().url)


@final
@dataclass(frozen=True)
class Patience:
    """How often to try again, and how long to wait before the second try; pauses double."""

    retries: int = 4
    pause_s: float = 0.5


class _Part(msgspec.Struct, frozen=True, kw_only=True):
    """What is known of a file that came in part."""

    url: str
    validator: str | None
    total: int | None


class _CutError(Exception):
    """The connection ended before the file did."""


def fetch(
    wanted: Wanted, *, refresh: bool = False, patience: Patience | None = None
) -> tuple[FetchRecord, bool]:
    """Fetch a file, unless it is there; return its record, and whether it was fetched now.

    It replaces an older one when it is complete and checked. Whatever happens before, the older
    one stays as it is, and of a large file the part that came is kept for the next try.

    Parameters
    ----------
    wanted : Wanted
        What to fetch.
    refresh : bool
        Fetch it though it is there.
    patience : Patience, optional
        How often to try.

    Raises
    ------
    InputError
        It cannot be fetched or written, is not what was asked for, or has another checksum; or
        there is a file of that name that was not fetched. One line.
    """
    address = wanted.address
    target = wanted.target
    if not refresh and target.exists():
        record = read_record(target)
        if record is None:
            raise InputError(
                f"{target}: exists, but {record_path(target).name} does not, so that it was not "
                "fetched; choose another --out, or replace it with --refresh"
            )
        if record.url == address and sha256_of(target) == record.sha256:
            _check_sum(wanted, record.sha256)
            return record, False
    make_folder(target.parent)
    return _fetched(wanted, address, patience or Patience()), True


def _fetched(wanted: Wanted, address: str, patience: Patience) -> FetchRecord:
    part = wanted.target.with_name(f".{wanted.target.name}.part")
    if not wanted.resumable:
        _discard(part)
    began_with = _size(part)
    _receive(wanted, address, part, patience)
    try:
        return _made(wanted, address, part)
    except InputError:
        if not began_with or _size(part):
            raise
    # The part that was there did not belong to the rest: once more from the beginning.
    _receive(wanted, address, part, patience)
    return _made(wanted, address, part)


def _made(wanted: Wanted, address: str, part: Path) -> FetchRecord:
    """Check what came and put the file in its place."""
    target = wanted.target
    try:
        with atomic_path(target) as temporary:
            wanted.make(part, temporary)
            digest = sha256_of(temporary)
            _check_sum(wanted, digest)
            record = FetchRecord(
                url=address,
                fetched=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
                sha256=digest,
                size_bytes=temporary.stat().st_size,
                what=wanted.what,
            )
    except UnfitError as error:
        raise InputError(f"{urlsplit(address).netloc}: {error}{_as_it_was(target)}") from None
    finally:
        _discard(part)
    write_record(target, record)
    return record


def _check_sum(wanted: Wanted, digest: str) -> None:
    if wanted.sha256 is not None and digest != wanted.sha256.strip().lower():
        raise InputError(
            f"{wanted.target}: SHA-256 {digest[:16]}..., expected {wanted.sha256[:16]}...; "
            f"what came is another file, or damaged{_as_it_was(wanted.target)}"
        )


def _as_it_was(target: Path) -> str:
    return f"; {target} is as it was" if target.exists() else ""


def _receive(wanted: Wanted, address: str, part: Path, patience: Patience) -> None:
    """Bring what a service has into a file, in several goes where the connection is cut."""
    with new_session(patience.retries, patience.pause_s) as session:
        for go in range(patience.retries + 1):
            if go:
                time.sleep(min(patience.pause_s * 2 ** (go - 1), _LONGEST_PAUSE_S))
            try:
                return _receive_once(session, wanted, address, part, patience)
            except _CutError as error:
                reason = str(error)
    kept = f"; the {_size(part)} bytes that came are kept for the next try" if _size(part) else ""
    if not wanted.resumable:
        _discard(part)
        kept = ""
    raise InputError(
        f"{urlsplit(address).netloc}: the connection is cut, {patience.retries + 1} times in a "
        f"row ({reason}){kept}{_as_it_was(wanted.target)}"
    )


def _receive_once(
    session: requests.Session, wanted: Wanted, address: str, part: Path, patience: Patience
) -> None:
    known = _known(part, address) if wanted.resumable else None
    there = 0 if known is None else _size(part)
    headers = {}
    if known is not None and there:
        headers["Range"] = f"bytes={there}-"
        if known.validator is not None:
            headers["If-Range"] = known.validator
    with (
        in_words(address),
        session.get(address, headers=headers, stream=True, timeout=TIMEOUT) as response,
    ):
        if response.status_code == requests.codes.requested_range_not_satisfiable:
            # What is there is not a part of what the service has now.
            _discard(part)
            raise _CutError("the file has changed")
        check_status(response, patience.retries)
        goes_on = _continues(response, known, there, part)
        total = _total(response, there if goes_on else 0)
        _note(part, address, response, total)
        _write(response, part, there if goes_on else 0, total, wanted.target.name)
    if total is not None and _size(part) != total:
        if _size(part) > total:
            _discard(part)
        raise _CutError(f"{_size(part)} of {total} bytes came")


def _write(
    response: requests.Response, part: Path, there: int, total: int | None, name: str
) -> None:
    """Append to a part what comes, or begin it anew."""
    try:
        with (
            part.open("ab" if there else "wb") as stream,
            tqdm(
                total=total,
                initial=there,
                desc=name,
                unit="B",
                unit_scale=True,
                disable=None,
                leave=False,
            ) as progress,
        ):
            # read1 hands over what has come; read would lose it where the connection is cut.
            while block := response.raw.read1(_BLOCK, decode_content=False):
                stream.write(block)
                progress.update(len(block))
    except OSError as error:
        raise InputError(f"{part}: cannot be written ({error.strerror})") from None
    except urllib3.exceptions.HTTPError as error:
        raise _CutError(type(error).__name__) from None


def _continues(response: requests.Response, known: _Part | None, there: int, part: Path) -> bool:
    """Return whether an answer is the rest of what is there; away with that if it cannot be."""
    if response.status_code != requests.codes.partial_content or known is None:
        return False
    span = response.headers.get("Content-Range", "")
    total = span.rpartition("/")[2]
    same = known.total is None or not total.isdigit() or int(total) == known.total
    if not (span.startswith(f"bytes {there}-") and same):
        _discard(part)
        raise _CutError("the file has changed")
    return True


def _total(response: requests.Response, there: int) -> int | None:
    length = response.headers.get("Content-Length", "")
    return there + int(length) if length.isdigit() else None


def _note(part: Path, address: str, response: requests.Response, total: int | None) -> None:
    """Write down what a part belongs to."""
    validator = response.headers.get("ETag") or response.headers.get("Last-Modified")
    if validator is not None and validator.startswith("W/"):
        validator = None
    note = _Part(url=address, validator=validator, total=total)
    try:
        _note_path(part).write_bytes(msgspec.json.encode(note))
    except OSError as error:
        raise InputError(f"{part}: cannot be written ({error.strerror})") from None


def _known(part: Path, address: str) -> _Part | None:
    try:
        known = msgspec.json.decode(_note_path(part).read_bytes(), type=_Part)
    except (OSError, msgspec.DecodeError):
        return None
    return known if known.url == address else None


def _note_path(part: Path) -> Path:
    return part.with_name(part.name + ".json")


def _size(part: Path) -> int:
    return part.stat().st_size if part.exists() else 0


def _discard(part: Path) -> None:
    for file in (part, _note_path(part)):
        with suppress(FileNotFoundError):
            file.unlink()
