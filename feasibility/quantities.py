"""Quantities that carry a unit (astropy, pint, unyt and their like), converted to plain numbers.

None of these packages is imported: a quantity is known by its methods.
"""

from typing import Any, Final

import numpy as np

from feasibility.errors import InputError

_HOLDERS: Final = ("unit", "units")
"""Attributes by which objects tell that their numbers have a unit."""


def plain_numbers(label: str, value: Any, units: tuple[str, ...]) -> Any:
    """Return a value without units, converted where it has some.

    Parameters
    ----------
    label : str
        What messages begin with, such as ``"Legs m0"``.
    value : object
        Numbers, a quantity, or a list whose entries may be quantities.
    units : tuple of str
        The unit wanted, as astropy and pint spell it, "" for a pure number; no units for numbers
        that must not have one. Several
        units are those of the entries along the last axis of a table, which has to be given as
        rows of single quantities if it has units at all.

    Raises
    ------
    InputError
        A unit cannot be converted, or would be dropped; entries are masked, complex, or times.
    """
    if isinstance(value, int | float):
        return value
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InputError(f"{label}: has masked entries; expected a number in every row")
    if _unit(value) is not None:
        if len(set(units)) != 1:
            raise InputError(f"{label}: has a unit ({_unit(value)}); expected {_wanted(units)}")
        return _converted(label, value, units[0])
    kind = getattr(getattr(value, "dtype", None), "kind", None)
    if isinstance(value, list | tuple):
        return _plain_list(label, value, units)
    if kind == "O" and np.ndim(value) > 0:
        return _plain_list(label, np.asarray(value), units)
    if kind in ("M", "m"):
        raise InputError(f"{label}: dates or time spans of numpy; expected {_wanted(units)}")
    if kind == "c":
        raise InputError(f"{label}: complex numbers; expected {_wanted(units)}")
    return value


def _plain_list(label: str, value: Any, units: tuple[str, ...]) -> Any:
    """Return a list whose entries are converted one by one; the same list if none has a unit."""
    nested = any(
        isinstance(entry, list | tuple) or getattr(entry, "ndim", 0) > 0 for entry in value
    )
    by_entry = len(units) == len(value) > 1 and not nested
    plain = [
        plain_numbers(label, entry, (units[place],) if by_entry else units)
        for place, entry in enumerate(value)
    ]
    if all(new is old for new, old in zip(plain, value, strict=True)):
        return value
    return plain


def _unit(value: Any) -> str | None:
    """Return the unit's name, None for what has none."""
    for holder in (value, getattr(value, "dtype", None)):
        for name in _HOLDERS:
            unit = getattr(holder, name, None)
            if unit is not None:
                return str(unit) or "dimensionless"
    return None


def _converted(label: str, value: Any, unit: str) -> Any:
    try:
        if callable(getattr(value, "to_value", None)):
            return value.to_value(unit)
        return value.to(unit).magnitude
    except Exception:  # each package has errors of its own
        raise InputError(
            f"{label}: has a unit ({_unit(value)}) that cannot be converted; "
            f"expected {_wanted((unit,))}"
        ) from None


def _wanted(units: tuple[str, ...]) -> str:
    named = " and ".join(dict.fromkeys(unit for unit in units if unit))
    return f"plain numbers in {named}" if named else "plain numbers"
