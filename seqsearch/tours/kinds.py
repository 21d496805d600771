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

    Raises
    ------
    InputError
        A class cannot be loaded, has another tag than the name of its entry point, or brings a
        kind that there is already.
    """
    kinds = {_tag(kind): kind for kind in ours}
    for entry in metadata.entry_points(group=entry_points):
        label = f"kind {entry.name!r} of {entry_points}"
        if entry.name in kinds:
            raise InputError(f"{label}: {entry.value} brings a kind that there is already")
        try:
            kind = entry.load()
            tag = _tag(kind)
        except Exception as error:
            raise InputError(
                f"{label}: {entry.value} cannot be loaded ({type(error).__name__}: {error})"
            ) from error
        if tag != entry.name:
            raise InputError(f"{label}: {entry.value} has the tag {tag!r}, expected the same name")
        kinds[entry.name] = kind
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
