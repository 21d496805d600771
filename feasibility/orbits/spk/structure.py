"""Whether the data of a segment have the structure of its type, before SPICE trusts them.

Layouts as in NAIF's "SPK Required Reading".
"""

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError

_Array = NDArray[np.float64]

_MOST_DEGREE: Final = 27
"""SPICE's interpolation has room for so much."""

_MOST_TERMS: Final = 25
_STEP: Final = 100
"""Every hundredth epoch stands in a directory."""


def check_data(file: Path, body: int, kind: int, data: _Array, span: tuple[float, float]) -> None:
    """Refuse a segment that is damaged, or of a type that is not read.

    Parameters
    ----------
    file, body
        For messages.
    kind : int
        Type of the segment.
    data : (n,) float64
        Its words.
    span : tuple of float
        For which seconds of TDB past J2000 its summary says that it has states.

    Raises
    ------
    InputError
        It cannot be used.
    """
    check = _CHECKS.get(kind)
    if check is None:
        raise InputError(
            f"{file}: body {body} is in a segment of type {kind}, expected one of types "
            f"{', '.join(map(str, _CHECKS))}"
        )
    if not check(data, span):
        raise InputError(f"{file}: damaged: the data of body {body} are not those of type {kind}")


def _differences(data: _Array, span: tuple[float, float], terms: int, trailer: int) -> bool:
    """Check modified differences: records, their last epochs, a directory, a count."""
    count = _count(data[-1])
    size = 4 * terms + 11
    if count is None or terms > _MOST_TERMS:
        return False
    if len(data) != count * size + count + count // _STEP + trailer:
        return False
    records = data[: count * size].reshape(count, size)
    orders, most = records[:, -3:], records[:, -4]
    good = (orders >= 0) & (orders <= terms) & (orders == np.floor(orders))
    good_most = (most >= 2) & (most <= terms + 2) & (most == np.floor(most))
    epochs = data[count * size : count * (size + 1)]
    return bool(good.all() and good_most.all() and _ascending(epochs) and epochs[-1] >= span[1])


def _type_1(data: _Array, span: tuple[float, float]) -> bool:
    return _differences(data, span, 15, 1)


def _type_21(data: _Array, span: tuple[float, float]) -> bool:
    terms = _count(data[-2]) if len(data) > 2 else None
    return terms is not None and _differences(data, span, terms, 2)


def _chebyshev(components: int) -> Callable[[_Array, tuple[float, float]], bool]:
    def check(data: _Array, span: tuple[float, float]) -> bool:
        if len(data) < 4:
            return False
        begin, length = float(data[-4]), float(data[-3])
        size, count = _count(data[-2]), _count(data[-1])
        if size is None or count is None or not (np.isfinite(begin) and length > 0):
            return False
        terms, rest = divmod(size - 2, components)
        fits = rest == 0 and 1 <= terms <= 2 * _MOST_DEGREE and len(data) == size * count + 4
        # The last record may be asked for a little beyond its end.
        slack = 1e-6 * length
        covers = begin <= span[0] + slack and span[1] <= begin + count * length + slack
        return fits and covers

    return check


def _unequal(data: _Array, span: tuple[float, float]) -> bool:
    """Check states at unequal steps: states, epochs, a directory, degree or window, a count."""
    count = _count(data[-1])
    degree = _count(data[-2]) if len(data) > 2 else None
    if count is None or degree is None or degree > _MOST_DEGREE:
        return False
    if len(data) != 7 * count + (count - 1) // _STEP + 2:
        return False
    epochs = data[6 * count : 7 * count]
    return _ascending(epochs) and bool(epochs[0] <= span[0] and span[1] <= epochs[-1])


def _equal(data: _Array, span: tuple[float, float]) -> bool:
    """Check states at equal steps: states, begin, step, degree or window, a count."""
    if len(data) < 4:
        return False
    begin, step = float(data[-4]), float(data[-3])
    degree, count = _count(data[-2]), _count(data[-1])
    if degree is None or count is None or degree > _MOST_DEGREE or not step > 0:
        return False
    return len(data) == 6 * count + 4 and begin <= span[0] and np.isfinite(begin + step)


_CHECKS: Final[dict[int, Callable[[_Array, tuple[float, float]], bool]]] = {
    1: _type_1,
    2: _chebyshev(3),
    3: _chebyshev(6),
    8: _equal,
    9: _unequal,
    12: _equal,
    13: _unequal,
    21: _type_21,
}


def _count(value: float) -> int | None:
    """Return a number that counts something, None where it does not."""
    number = float(value)
    return int(number) if number.is_integer() and 1 <= number < 2**31 else None


def _ascending(epochs: _Array) -> bool:
    return bool(np.isfinite(epochs).all() and (np.diff(epochs) > 0).all())
