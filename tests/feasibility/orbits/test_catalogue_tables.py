"""Readers of asteroid tables: every layout, and one clear line for every fault."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from feasibility.constants import AU
from feasibility.errors import InputError
from feasibility.orbits import classical_to_cartesian, earth, read_catalogue

# One made-up body in every layout: a 2.5 AU, e 0.1, i 7, node 100, argp 200, M 300, MJD 54800.
GTOC2 = (
    "spkid  a(AU)  e  i(deg)  LAN(deg)  argperi(deg)  M(deg)  epoch(MJD)  group.\r\n"
    "2000001  2.5  0.1  7  100  200  300  54800  1\r\n"
    "2000002  2.6  0.2  8  110  210  310  54801  4\r\n"
    "1\t\t0.99998 0.0167 0.00088 175.4 287.6 257.6  54000   5"
)
GTOC4 = (
    "# A list of made-up asteroids\r\n"
    "# Name  Epoch (MJD)  a (AU)  e  i (deg)  LAN (deg)  arg. periap. (deg) mean anomaly (deg)\r\n"
    "'1580'  54800.0  2.5e+00  1.0e-01  7.0e+00  1.0e+02  2.0e+02  3.0e+02\r\n"
    "'2008WL' 54801.0  2.6e+00  2.0e-01  8.0e+00  1.1e+02  2.1e+02  3.1e+02"
)
GTOC5 = (
    "#Epoch   a     e    i    w     Node      M     Object\r\n"
    "#(TDB)   (AU)       (deg) (deg)\r\n"
    "\r\n"
    " 54800   2.5   0.1  7   200   \t 100     300   433 Eros\r\n"
    " 54801   2.6   0.2  8   210      110     310   (6344 P-L)\r\n"
    "\r\n"
    "#Epoch   a     e    i    w     Node      M     Object\r\n"
)
GTOC7 = (
    "Num\tEpoch\ta\t\te\t\ti\t\tw\t\tNode\t\tM\t\tName\r\n"
    "------\t-----\t----------\t-----\r\n"
    "11\t54800\t2.5\t0.1\t7\t200\t100\t300\tVesta\r\n"
    "12\t54801\t2.6\t0.2\t8\t210\t110\t310\t1999 TK107\r\n"
)
GTOC11 = (
    "# id epoch_mjd a_au e inc_deg raan_deg argp_deg M_deg mass_kg   (osculating, MJD)\n"
    "11 54800 2.5 0.1 7 100 200 300 1.17E+14\n"
    "12 54801 2.6 0.2 8 110 210 310 1.0E+13\n"
)
GTOC12 = (
    "ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)\n"
    "11 54800 2.5 0.1 7 100 200 300\n"
    "12 54801 2.6 0.2 8 110 210 310\n"
)
TABLES = {
    "GTOC2": (GTOC2, [2000001, 2000002], ("2000001", "2000002")),
    "GTOC4": (GTOC4, [1, 2], ("1580", "2008WL")),
    "GTOC5": (GTOC5, [1, 2], ("433 Eros", "(6344 P-L)")),
    "GTOC7": (GTOC7, [11, 12], ("Vesta", "1999 TK107")),
    "GTOC11": (GTOC11, [11, 12], ("11", "12")),
    "GTOC12": (GTOC12, [11, 12], ("11", "12")),
}


def written(tmp_path, text, name="table.txt"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("layout", TABLES)
def test_every_layout_gives_the_same_orbits(tmp_path, layout):
    text, ids, names = TABLES[layout]
    catalogue = read_catalogue(written(tmp_path, text))
    assert_array_equal(catalogue.ids, ids)
    assert catalogue.names == names
    assert_array_equal(catalogue.epoch_mjd2000, [54800 - 51544, 54801 - 51544])
    expected = [
        [2.5 * AU, 0.1, *np.radians([7, 100, 200, 300])],
        [2.6 * AU, 0.2, *np.radians([8, 110, 210, 310])],
    ]
    assert_allclose(catalogue.elements, expected, rtol=1e-15)
    assert catalogue.source.endswith("table.txt")


def test_what_is_no_part_of_the_orbit_is_kept_beside_it(tmp_path):
    further = {name: {} for name in TABLES}
    further["GTOC2"] = {"group": [1.0, 4.0]}
    further["GTOC11"] = {"mass": [1.17e14, 1e13]}
    for name, (text, _, _) in TABLES.items():
        extra = read_catalogue(written(tmp_path, text)).extra
        assert {key: column.tolist() for key, column in extra.items()} == further[name]


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("layout", TABLES)
def test_line_ends_a_byte_order_mark_and_the_file_name_do_not_matter(tmp_path, layout, line_end):
    text, ids, _ = TABLES[layout]
    text = "\ufeff" + text.replace("\r\n", "\n").replace("\n", line_end)
    assert_array_equal(read_catalogue(written(tmp_path, text, "GTOC9.csv")).ids, ids)


def fault(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


FAULTS = {
    "too few columns": (
        fault(GTOC7, "\t200\t100\t300\tVesta", "\t200\t100"),
        "line 3: 7 columns, expected 9 of GTOC7: id, epoch, a",
    ),
    "too many columns": (
        fault(GTOC12, "200 300\n12", "200 300 1\n12"),
        "line 2: 9 columns, expected 8 of GTOC12",
    ),
    "truncated last line": (
        fault(GTOC4, "  2.1e+02  3.1e+02", "  2.1e+"),
        "line 4: 6 columns, expected 7.*is the file truncated",
    ),
    "number cut in the last line": (
        fault(GTOC4, "3.1e+02", "3.1e+"),
        "line 4: M is '3.1e\\+'.*is the file truncated",
    ),
    "not a number": (
        fault(GTOC5, "2.6", "2,6"),
        "line 5: a is '2,6'; expected a semi-major axis in AU",
    ),
    "NaN": (fault(GTOC11, "0.2", "nan"), "line 3: e is 'nan'; expected an eccentricity"),
    "infinity": (fault(GTOC11, "310", "inf"), "line 3: M is 'inf'; expected an angle"),
    "underscore": (fault(GTOC12, "54801", "54_801"), "line 3: epoch is '54_801'"),
    "hyperbola": (fault(GTOC2, "0.2", "1.2"), "line 3: e is '1.2'; .* 0 <= e < 1"),
    "parabola": (fault(GTOC2, "0.2", "1.0"), "line 3: e is '1.0'; .* 0 <= e < 1"),
    "negative eccentricity": (fault(GTOC2, "0.2", "-0.2"), "line 3: e is '-0.2'"),
    "negative semi-major axis": (fault(GTOC7, "2.6", "-2.6"), "line 4: a is '-2.6'.*more than 0"),
    "zero semi-major axis": (fault(GTOC7, "2.6", "0"), "line 4: a is '0'.*more than 0"),
    "semi-major axis in metres": (fault(GTOC7, "2.6", "3.9e11"), "line 4: a is.*in AU"),
    "inclination": (fault(GTOC12, "0.2 8", "0.2 188"), "line 3: i is '188'; expected.*180"),
    "Julian date": (fault(GTOC12, "54801", "2454801.5"), "line 3: epoch is.*MJD"),
    "duplicate id": (
        fault(GTOC12, "12 54801", "11 54801"),
        "line 3: id 11 was given to line 2 already",
    ),
    "id with a fraction": (fault(GTOC12, "12 54801", "1.5 54801"), "line 3: id is '1.5'"),
    "no quotes": (fault(GTOC4, "'1580'", "1580"), "line 3: expected a name in single quotes"),
    "no rows": (GTOC7.split("11\t", 1)[0], "the table is empty; expected rows of GTOC7"),
    "only the Earth": (
        re.sub(r"200000.*\r\n", "", GTOC2),
        "the table is empty; expected rows of GTOC2",
    ),
    "no header": (GTOC12.split("\n", 1)[1], "line 1: unknown layout; expected the header.*GTOC7"),
    "another header": ("name,a,e\n1,2,3\n", "line 1: unknown layout"),
    "only comments": ("# nothing\n# here\n", "unknown layout"),
    "empty": ("", "the file is empty"),
    "only white space": ("\r\n \r\n", "the file is empty"),
    "bytes that are no text": (
        GTOC7.encode().replace(b"1999 TK", b"1999 \xe9\x00"),
        "line 4: byte 0x00 is no text",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_with_file_line_and_expectation(tmp_path, name):
    text, message = FAULTS[name]
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        read_catalogue(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@settings(deadline=None)
@given(
    st.sampled_from(list(TABLES)),
    st.integers(0, 400),
    st.integers(0, 40),
    st.binary(max_size=8) | st.sampled_from([b" nan ", b"\t-1", b"1e999", b"'", b"\n"]),
)
def test_a_damaged_table_is_read_or_refused_but_never_crashes(
    tmp_path_factory, layout, where, length, replacement
):
    data = TABLES[layout][0].encode()
    data = data[:where] + replacement + data[where + length :]
    path = tmp_path_factory.getbasetemp() / "damaged.txt"
    path.write_bytes(data)
    message = f"{path}: a catalogue came back"
    try:
        catalogue = read_catalogue(path)
    except InputError as error:
        message = str(error)
    else:
        assert np.isfinite(catalogue.states(0.0)).all()
    assert message.startswith(str(path))
    assert "\n" not in message


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.txt: no such file"):
        read_catalogue(tmp_path / "nowhere.txt")
    with pytest.raises(InputError, match="is a folder"):
        read_catalogue(tmp_path)


def test_a_complete_last_line_without_line_end_is_not_called_truncated(tmp_path):
    assert len(read_catalogue(written(tmp_path, GTOC12.rstrip("\n")))) == 2


# The first body, the last body and the number of rows of the published tables: id, name, then
# epoch [MJD], a [AU], e, i, node, argp, M [deg].
OFFICIAL = {
    "official/GTOC2-DATA.txt": (
        910,
        (2011542, "2011542", 54000, 3.9501468, 0.2391642, 6.87574, 16.88982, 48.9603, 229.49648),
        (
            *(3350633, "3350633", 54000, 0.85107872, 0.46865622),
            *(2.9133876, 92.154235, 68.436379, 235.83518),
        ),
    ),
    "official/GTOC4-DATA.txt": (
        1436,
        (
            *(1, "1580", 54800, 2.1968033753931699, 0.48768310678199733),
            *(52.090793903855442, 62.324795115974354, 159.53983855505257, 3.5216868177911254),
        ),
        None,
    ),
    "official/GTOC5-DATA.txt": (
        7075,
        (
            *(1, "14790 Beletskij", 55400, 2.6932634, 0.31605150),
            *(6.27657, 321.51547, 31.06329, 350.7064700),
        ),
        None,
    ),
    "official/GTOC7-DATA.txt": (
        16256,
        (
            *(1, "Vesta", 56800, 2.3614601, 0.0886122),
            *(7.1404900, 103.8512900, 151.2172200, 326.5320247),
        ),
        (
            *(16256, "1999 TK107", 56800, 2.9995128, 0.1041154),
            *(9.5223400, 310.4615400, 320.7798800, 6.4792818),
        ),
    ),
    "gtoc11_asteroids.txt": (
        83453,
        (
            *(1, "1", 59396, 3.23790035, 0.067977382),
            *(13.97503429, 178.1380039, 352.4606128, 68.14966237),
        ),
        (
            *(83453, "83453", 59396, 2.242680558, 0.178203792),
            *(4.234316005, 95.06271134, 123.4163269, 168.7385926),
        ),
    ),
}


@pytest.mark.parametrize("table", OFFICIAL)
def test_official_tables_are_read_whole(shared, table):
    n, first, last = OFFICIAL[table]
    catalogue = read_catalogue(shared / "gtoc" / table)
    assert len(catalogue) == n
    for row, body in ((0, first), (-1, last)):
        if body is None:
            continue
        identity, name, epoch_mjd, a, e, *angles = body
        assert catalogue.ids[row] == identity
        assert catalogue.names[row] == name
        assert catalogue.epoch_mjd2000[row] == epoch_mjd - 51544
        assert_allclose(catalogue.elements[row], [a * AU, e, *np.radians(angles)], rtol=1e-14)


def test_geographos_is_at_the_same_place_in_gtoc4_and_gtoc5(shared):
    """The tables differ in the order of node and argument of perihelion; the sky does not."""
    gtoc4 = read_catalogue(shared / "gtoc/official/GTOC4-DATA.txt")
    gtoc5 = read_catalogue(shared / "gtoc/official/GTOC5-DATA.txt")
    one = gtoc4.states_at([gtoc4.names.index("1620")], 4000.0)[0]
    two = gtoc5.states_at([gtoc5.names.index("1620 Geographos")], 4000.0)[0]
    assert np.linalg.norm(one[:3] - two[:3]) < 1e-3 * AU
    assert np.linalg.norm(one[3:] - two[3:]) < 50.0


def test_the_earth_is_the_one_gtoc2_lists(shared):
    line = (shared / "gtoc/official/GTOC2-DATA.txt").read_text().split("\n")[-1].split()
    a, e, *angles = (float(word) for word in line[1:7])
    expected = [a * AU, e, *np.radians(angles)]
    assert_allclose(earth().elements[0], expected, rtol=1e-12)
    assert_allclose(
        earth().states(54000.0 - 51544.0)[0], classical_to_cartesian(expected), rtol=1e-6
    )
