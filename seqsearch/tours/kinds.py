"""Records of a tour file that name their kind: ours, and those that other packages bring."""

from collections.abc import Iterable, Mapping
from importlib import metadata
from typing import Any, TypeVar

import msgspec

from feasibility.errors import InputError

_T = TypeVar("_T")


def kinds_of(ours: Iterable[type[_T]], entry_points: str) -> dict[str, type[_T]]:
    """Return classes by the names of their kinds.

    Parameters
    ----------
    ours : iterable of type
        Tagged structs of this package.
    entry_points : str
        Group of the entry points by which other packages bring more, named as their kinds.
    """
    kinds = {_tag(kind): kind for kind in ours}
    for entry in metadata.entry_points(group=entry_points):
        kinds.setdefault(entry.name, entry.load())
    return kinds


def record_of(plain: Any, kinds: Mapping[str, type[_T]], what: str) -> _T:
    """Return the record that a JSON object describes.

    Raises
    ------
    InputError
        Its kind is unknown, or its fields do not fit the kind.
    """
    kind = str(plain.get("kind")) if isinstance(plain, dict) else ""
    if kind not in kinds:
        raise InputError(f"{what} of kind {kind!r}, known are {', '.join(sorted(kinds))}")
    try:
        return msgspec.convert(plain, type=kinds[kind])
    except msgspec.ValidationError as error:
        raise InputError(f"{what} of kind {kind!r}: {error}") from None


def _tag(kind: type[Any]) -> str:
    return str(kind.__struct_config__.tag)
