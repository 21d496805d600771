"""Expressions that select bodies: what they mean, and what is refused."""

import numpy as np
import pytest

from feasibility.errors import InputError
from feasibility.orbits import read_catalogue, synthetic_main_belt
from feasibility.orbits.selection import selected, selected_rows
from tests.helpers.publishers import Body, mpcorb, plain

NAN = float("nan")
COLUMNS = {
    "id": np.array([1, 2, 3, 4]),
    "a": np.array([2.0, 2.2, 2.5, 3.0]),
    "e": np.array([0.1, 0.3, 0.05, 0.2]),
    "node": np.array([10.0, 20.0, 30.0, 40.0]),
    "H": np.array([15.0, NAN, 17.0, 12.0]),
    "neo": np.array([1.0, 0.0, NAN, 0.0]),
}

CASES = {
    "a > 2.2 and e < 0.2 and H < 16": [],
    "a >= 2.2": [2, 3, 4],
    "2.0 < a <= 2.5": [2, 3],
    "H < 16": [1, 4],
    "not (H < 16)": [2, 3],
    "H != 15": [3, 4],
    "H == H": [1, 3, 4],
    "neo": [1],
    "not neo and a < 2.6": [2, 3],
    "id in (1, 4, 9)": [1, 4],
    "id not in [1, 4]": [2, 3],
    "a * (1 - e) < 1.7": [2],
    "-a < -2.4 or a ** 2 == 4": [1, 3, 4],
    "sqrt(a) > 1.5 and abs(e - 0.2) < 0.01": [4],
    "om > 15": [2, 3, 4],
    "True": [1, 2, 3, 4],
    "a / 0 > 1": [1, 2, 3, 4],
    "9 ** 9 ** 9 > a": [1, 2, 3, 4],
    " ( a\n > 2.6 ) ": [4],
}


@pytest.mark.parametrize("expression", CASES)
def test_what_expressions_select(expression):
    if not CASES[expression]:
        with pytest.raises(InputError, match="leaves none of 4 bodies"):
            selected(expression, COLUMNS, "t.txt")
        return
    rows = selected(expression, COLUMNS, "t.txt")
    assert COLUMNS["id"][rows].tolist() == CASES[expression]


FAULTS = {
    "b > 1": "no column 'b'; columns are id, a, e, node, H, neo",
    "a >": "is no condition; expected one such as .* of the columns id, a",
    "a": None,
    "a + 1": "'a . 1' is no condition",
    "a is 2": "'is' is not understood",
    "a > '2'": "\"'2'\" is not understood",
    "a > True": "True is no number",
    "__import__('os').system('true') > 0": "is not understood",
    "a.real > 2": "'a.real' is not understood",
    "(lambda: 1)() > 0": "is not understood",
    "a in b": "'in' needs a list of numbers",
    "a = 2": "is no condition",
    "": "is no condition",
    "a > 2; e < 1": "is no condition",
    "a > 2 and (e := 2)": "is no condition",
    "[a for a in (1,)] > 2": "is not understood",
    "\x00": "is no condition",
    "(" * 900 + "a > 2" + ")" * 900: "is no condition|leaves",
    "a > 2 or " * 500 + "a > 2": "letters, expected 2000 at most",
    "a > " + "9" * 400: "too large",
    "a & 1 > 2": "is not understood",
}


@pytest.mark.parametrize("expression", [name for name, fault in FAULTS.items() if fault])
def test_what_is_not_understood_is_named_in_one_line(expression):
    with pytest.raises(InputError, match=FAULTS[expression]) as caught:
        selected(expression, COLUMNS, "t.txt")
    assert str(caught.value).startswith("t.txt: select ")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_a_table_is_selected_by_its_own_numbers(tmp_path):
    path = tmp_path / "table"
    path.write_text(plain([Body(k, a=2.0 + 0.1 * k) for k in range(1, 8)]))
    chosen = read_catalogue(path, select="a >= 2.2 and id != 5")
    assert chosen.ids.tolist() == [2, 3, 4, 6, 7]
    path.write_text(mpcorb([Body(k, f"Body{k}", h=10.0 + k) for k in range(1, 8)]))
    chosen = read_catalogue(path, select="H > 14.5")
    assert chosen.ids.tolist() == [5, 6, 7]
    assert chosen.names == ("5 Body5", "6 Body6", "7 Body7")
    assert chosen.extra["H"].tolist() == [15.0, 16.0, 17.0]


def test_a_catalogue_is_selected_in_au_and_degrees():
    belt = synthetic_main_belt(300, np.random.default_rng(1))
    chosen = selected_rows(belt, "i < 5 and 2.5 < a < 2.9 and Q < 3.2")
    a, e, i = belt.elements[:, 0] / 1.49597870691e11, belt.elements[:, 1], belt.elements[:, 2]
    expected = (np.degrees(i) < 5) & (a > 2.5) & (a < 2.9) & (a * (1 + e) < 3.2)
    assert chosen.ids.tolist() == belt.ids[expected].tolist()
