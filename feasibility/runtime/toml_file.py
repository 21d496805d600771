"""TOML files read into msgspec's structs: one reader, and mistakes named in the words of the file.

A struct is a table and its fields are the keys; tables may stand within tables, in lists and
in unions that a key such as ``kind`` tells apart. With ``forbid_unknown_fields=True`` an unknown
key is an error that lists the known ones.
"""

import codecs
import math
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, TypeVar

import msgspec
from msgspec import inspect

from feasibility.errors import InputError

_T = TypeVar("_T")

_MAX_INTEGER: Final = 2**63 - 1

_PLACE: Final = re.compile(r"^(?P<text>.*?)(?: - at `\$(?P<place>.*)`)?$", re.DOTALL)
"""Msgspec's messages: ``Expected `float`, got `str` - at `$.spacecraft.thrust_n```."""

_STEP: Final = re.compile(r"\.(?P<key>[^.\[]+)|\[(?P<index>\d+|\.\.\.)\]")


def read_toml(path: Path, kind: type[_T]) -> _T:
    """Read a TOML file.

    Parameters
    ----------
    path : Path
        The file.
    kind : type
        Struct of the whole file.

    Raises
    ------
    InputError
        The file cannot be read, is not TOML, lacks a key, has an unknown one, or a value of
        the wrong type or range; the message is one line that names file, table and key.
    """
    return decode_toml(read_toml_text(path), kind, str(path))


def read_toml_text(path: Path) -> str:
    """Return the text of a TOML file, which need not be TOML.

    Raises
    ------
    InputError
        There is no such file, or it cannot be read or is not text.
    """
    try:
        data = path.read_bytes()
        # Windows' editors and shells begin a file with a byte order mark.
        utf_16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        return data.decode("utf-16" if utf_16 else "utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise InputError(f"{path}: cannot be read as a TOML file ({reason})") from None


def decode_toml(text: str, kind: type[_T], label: str) -> _T:
    """Return a TOML text as a struct.

    Parameters
    ----------
    text : str
        The TOML text.
    kind : type
        Struct of the whole text.
    label : str
        File name, or what else the messages begin with.

    Raises
    ------
    InputError
        As `read_toml`.
    """
    return convert_table(parse_toml(text, label), kind, label)


def parse_toml(text: str, label: str) -> dict[str, Any]:
    """Return a TOML text as plain data.

    Raises
    ------
    InputError
        The text is not TOML, or has a number beyond what 64 bits hold.
    """
    try:
        plain = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise InputError(f"{label}: not valid TOML ({reason})") from None
    for place, value in _numbers(plain, ""):
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f"{label}: {place} is {value}, expected a finite number")
        if isinstance(value, int) and abs(value) > _MAX_INTEGER:
            digits = int(value.bit_length() * math.log10(2.0)) + 1
            raise InputError(
                f"{label}: {place} is a whole number of about {digits} digits, expected at "
                f"most {_MAX_INTEGER}"
            )
    return plain


def _numbers(plain: object, place: str) -> Iterator[tuple[str, object]]:
    """Yield every number with its table and key."""
    if isinstance(plain, dict):
        for key, value in plain.items():
            yield from _numbers(value, f"{place}.{key}".lstrip("."))
    elif isinstance(plain, list):
        for value in plain:
            yield from _numbers(value, place)
    elif isinstance(plain, int | float):
        yield place, plain


def convert_table(plain: object, kind: type[_T], label: str, table: str = "") -> _T:
    """Return plain data, as TOML has them, as a struct.

    Parameters
    ----------
    plain : object
        A table of `parse_toml`.
    kind : type
        The struct of it.
    label : str
        File name, or what else the messages begin with.
    table : str
        Name of the table in its file, such as ``"search.scouts"``; empty for the whole file.

    Raises
    ------
    InputError
        A key is missing or unknown, or a value has the wrong type or range.
    """
    try:
        return msgspec.convert(plain, kind, strict=False)
    except msgspec.ValidationError as error:
        raise InputError(f"{label}: {_readable(str(error), plain, kind, table)}") from None


def _readable(message: str, plain: object, kind: type, table: str) -> str:
    """Rewrite msgspec's message in the words of a TOML file."""
    parts = _PLACE.match(message)
    text, place = (parts["text"], parts["place"] or "") if parts else (message, "")
    where = f"{table}{place}".lstrip(".")
    inside = f"in [{where}]" if where else "at top level"
    if text.startswith("Object contains unknown field"):
        known = ", ".join(_known_keys(place, plain, kind))
        return f"unknown key {text.split('`')[1]!r} {inside}; known keys are {known}"
    if text.startswith("Object missing required field"):
        return f"no key {text.split('`')[1]!r} {inside}, expected one"
    text = " ".join((text[:1].lower() + text[1:]).split())
    return f"{text} (at {where})" if where else text


def _known_keys(place: str, plain: object, kind: type) -> list[str]:
    """Return the keys of the table at `place`, of all that it can be if nothing tells which."""
    kinds = list(_options(inspect.type_info(kind)))
    for step in _STEP.finditer(place):
        kinds = [inner for outer in _told_apart(kinds, plain) for inner in _inner(outer, step)]
        plain = _value(plain, step)
    keys: dict[str, None] = {}
    for struct in _told_apart(kinds, plain):
        if isinstance(struct, inspect.StructType):
            keys.update({struct.tag_field: None} if struct.tag_field else {})
            keys.update({field.encode_name: None for field in struct.fields})
    return list(keys)


def _told_apart(kinds: list[inspect.Type], plain: object) -> list[inspect.Type]:
    """Leave out structs that the data's tag (``kind = ...``) says they are not."""
    if not isinstance(plain, dict):
        return kinds
    return [
        kind
        for kind in kinds
        if not isinstance(kind, inspect.StructType)
        or kind.tag_field is None
        or plain.get(kind.tag_field, kind.tag) == kind.tag
    ]


def _inner(kind: inspect.Type, step: re.Match[str]) -> Iterator[inspect.Type]:
    """Yield the types of what is at a key or an index of a table or list."""
    if isinstance(kind, inspect.StructType):
        for field in kind.fields:
            if field.encode_name == step["key"]:
                yield from _options(field.type)
    elif isinstance(kind, inspect.DictType):
        yield from _options(kind.value_type)
    elif isinstance(kind, inspect.ListType | inspect.VarTupleType):
        yield from _options(kind.item_type)
    elif isinstance(kind, inspect.TupleType) and step["index"].isdigit():
        yield from _options(kind.item_types[int(step["index"])])


def _options(kind: inspect.Type) -> Iterator[inspect.Type]:
    """Yield the members of unions, without what annotations add."""
    if isinstance(kind, inspect.Metadata):
        yield from _options(kind.type)
    elif isinstance(kind, inspect.UnionType):
        for member in kind.types:
            yield from _options(member)
    else:
        yield kind


def _value(plain: object, step: re.Match[str]) -> object:
    """Return what is at a key or an index, None where msgspec does not tell which (``[...]``)."""
    if isinstance(plain, dict) and step["key"] is not None:
        return plain.get(step["key"])
    if isinstance(plain, list) and step["index"] not in (None, "..."):
        return plain[int(step["index"])]
    return None
