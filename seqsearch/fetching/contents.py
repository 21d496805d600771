"""Whether an answer is data at all, before it is looked at more closely."""

from pathlib import Path
from typing import Any, Final

import msgspec

from seqsearch.fetching.download import UnfitError

_BEGIN: Final = 512


def check_no_page(content: bytes, expected: str) -> None:
    """Refuse a web page, such as the log-in of a network or an error in words.

    Raises
    ------
    UnfitError
        It is one, or nothing.
    """
    begin = content[:_BEGIN].lstrip().lower()
    if not begin:
        raise UnfitError(f"answers with nothing, expected {expected}")
    if begin.startswith((b"<!doctype", b"<html", b"<?xml", b"<head", b"<body")):
        raise UnfitError(f"answers with a web page, expected {expected}")


def read_answer(file: Path, expected: str) -> dict[str, Any]:
    """Return an answer in JSON.

    Raises
    ------
    UnfitError
        It is none, is cut off, or is not an object.
    """
    content = file.read_bytes()
    check_no_page(content, expected)
    try:
        answer = msgspec.json.decode(content)
    except msgspec.DecodeError as error:
        raise UnfitError(f"answers with no complete JSON ({error}), expected {expected}") from None
    if not isinstance(answer, dict):
        raise UnfitError(f"answers with JSON of another kind, expected {expected}")
    return answer
