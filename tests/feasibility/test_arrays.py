"""`StructOfArrays`: rows of columns, of nested structs and of tuples stay together."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.arrays import StructOfArrays


@dataclass(frozen=True, eq=False)
class _Inner(StructOfArrays):
    value: NDArray[np.float64]
    flag: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Outer(StructOfArrays):
    """The number of each row, and the same number in every other column."""

    number: NDArray[np.int64]
    state: NDArray[np.float64]
    inner: _Inner
    parts: tuple[NDArray[np.float64], ...]
    several: tuple[_Inner, ...]


def _inner(number):
    return _Inner(0.5 * number, number % 2 == 0)


def _outer(numbers):
    number = np.asarray(numbers, dtype=np.int64)
    return _Outer(
        number,
        np.column_stack([number, -number]).astype(float),
        _inner(number),
        (1.0 * number, 2.0 * number),
        (_inner(3 * number), _inner(5 * number)),
    )


def _assert_rows(struct, numbers):
    """Assert that every column of a struct has the rows of the given numbers."""
    expected = _outer(numbers)
    assert len(struct) == len(numbers)
    for name in ("number", "state"):
        assert np.array_equal(getattr(struct, name), getattr(expected, name))
        assert getattr(struct, name).dtype == getattr(expected, name).dtype
    for found, wanted in zip(
        (struct.inner, *struct.several), (expected.inner, *expected.several), strict=True
    ):
        assert np.array_equal(found.value, wanted.value)
        assert np.array_equal(found.flag, wanted.flag)
    for found, wanted in zip(struct.parts, expected.parts, strict=True):
        assert np.array_equal(found, wanted)


_numbers = st.lists(st.integers(-1000, 1000), max_size=12)


@given(_numbers, st.data())
def test_take_takes_the_same_rows_of_all_columns(numbers, data):
    struct = _outer(numbers)
    most = 15 if numbers else 0
    rows = data.draw(st.lists(st.integers(0, max(0, len(numbers) - 1)), max_size=most))
    _assert_rows(struct.take(np.array(rows, dtype=np.intp)), [numbers[row] for row in rows])
    mask = data.draw(hnp.arrays(bool, len(numbers)))
    kept = [number for number, keep in zip(numbers, mask, strict=True) if keep]
    _assert_rows(struct.take(mask), kept)
    assert type(struct.take(mask)) is _Outer


@given(st.lists(_numbers, min_size=1, max_size=5))
def test_concatenate_puts_rows_one_after_the_other_and_take_undoes_it(lists):
    whole = _Outer.concatenate([_outer(numbers) for numbers in lists])
    _assert_rows(whole, [number for numbers in lists for number in numbers])
    first = 0
    for numbers in lists:
        _assert_rows(whole.take(np.arange(first, first + len(numbers))), numbers)
        first += len(numbers)


@given(_numbers)
def test_a_struct_is_the_concatenation_of_its_rows(numbers):
    struct = _outer(numbers)
    rows = [struct.take(np.array([row])) for row in range(len(numbers))]
    _assert_rows(_Outer.concatenate([_outer([]), *rows]), numbers)


def test_what_was_taken_does_not_change_with_its_origin():
    struct = _outer([1, 2, 3])
    taken = struct.take(np.array([2, 0]))
    struct.number[:] = 9
    struct.parts[0][:] = 9.0
    _assert_rows(taken, [3, 1])


@dataclass(frozen=True, eq=False)
class _WithLegs(StructOfArrays):
    legs: tuple[Legs, ...]
    mass: NDArray[np.float64]


def test_legs_are_columns_as_well():
    legs = Legs(
        rv_dep=np.tile([1.5e11, 0, 0, 0, 3e4, 0], (4, 1)),
        rv_arr=np.tile([1.5e11, 0, 0, 0, 3e4, 0], (4, 1)),
        tof_days=[100.0, 200.0, 300.0, 400.0],
        m0=1000.0,
        thrust=0.3,
        isp=3000.0,
        m_dry=500.0,
    )
    struct = _WithLegs((legs, legs.take([3, 2, 1, 0])), np.arange(4.0))
    taken = struct.take(np.array([3, 1]))
    assert taken.legs[0].tof_days.tolist() == [400.0, 200.0]
    assert taken.legs[1].tof_days.tolist() == [100.0, 300.0]
    again = _WithLegs.concatenate([taken, struct])
    assert again.legs[0].tof_days.tolist() == [400.0, 200.0, 100.0, 200.0, 300.0, 400.0]
    assert len(again) == 6


def test_without_parts_there_is_nothing_to_concatenate():
    with pytest.raises((IndexError, ValueError)):
        _Outer.concatenate([])
