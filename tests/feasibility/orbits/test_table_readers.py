"""Tables as people and agencies write them: names, units, order, separators, encodings."""

# Lines of tables are as long as they are.
# ruff: noqa: E501

import codecs
import gzip
import re
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from feasibility.constants import AU
from feasibility.errors import InputError
from feasibility.orbits import read_catalogue

# In every table: a 2.5 AU, e 0.1, i 7, node 100, argp 200, M 300, MJD 54800.
EXPECTED = [2.5 * AU, 0.1, *np.radians([7, 100, 200, 300])]
RADIANS = "0.1221730476 1.745329252 3.490658504 5.235987756"


def read(tmp_path, text, name="table.txt"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_catalogue(path)


def quietly(tmp_path, text):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return read(tmp_path, text)


def one_warning(tmp_path, text, message):
    with pytest.warns(UserWarning, match=message) as caught:
        catalogue = read(tmp_path, text)
    assert len(caught) == 1
    assert "\n" not in str(caught[0].message)
    return catalogue


HEADERS = {
    "the layout of the README": "id epoch a e i node argp M mass\n3 54800 2.5 0.1 7 100 200 300 1e9\n",
    "without mass": "id epoch a e i node argp M\n3 54800 2.5 0.1 7 100 200 300\n",
    "another order": "ID a(AU) e i(deg) LAN(deg) argperi(deg) M(deg) epoch(MJD)\n"
    "3 2.5 .1 7 100 200 300 54800\n",
    "radians": f"id epoch a e i(rad) node(rad) argp(rad) M(rad)\n3 54800 2.5 0.1 {RADIANS}\n",
    "radians in brackets": f"id epoch a e i [rad] node [rad] w [rad] M [rad]\n3 54800 2.5 0.1 {RADIANS}\n",
    "radians by the name": f"id epoch a e i_rad om_rad w_rad ma_rad\n3 54800 2.5 .1 {RADIANS}\n",
    "days of 2000": "id epoch(MJD2000) a e i node argp M\n3 3256 2.5 0.1 7 100 200 300\n",
    "Julian dates": "id epoch(JD) a e i node argp M\n3 2454800.5 2.5 0.1 7 100 200 300\n",
    "kilometres": "id epoch a(km) e i node argp M\n3 54800 373994676.75 0.1 7 100 200 300\n",
    "metres": "id epoch a_m e i node argp M\n3 54800 3.7399467675e11 0.1 7 100 200 300\n",
    "dotted names": "spkid,epoch.mjd,a,e,inc,raan,aop,ma\n3,54800,2.5,0.1,7,100,200,300\n",
    "epochs twice": "spkid,epoch,epoch_mjd,epoch_cal,a,e,i,om,w,ma\n"
    "3,2454800.5,54800,20081130.0,2.5,0.1,7,100,200,300\n",
    "a name that is a unit": "id mjd a e i node argp M\n3 54800 2.5 0.1 7 100 200 300\n",
    "remarks with units": "id epoch (JD, TDB) a (in AU) e i (in rad) node (rad) w (rad) M (rad)\n"
    f"3 2454800.5 2.5 0.1 {RADIANS}\n",
    "commas below a header of blanks": "id epoch a e i node argp M\n3,54800,2.5,.1,7,100,200,300\n",
    "blanks below a header of commas": "! Name, Epoch(MJD), a, e, i, long. node, arg. peric., "
    "mean anomaly, absolute magnitude\n'3'  54800.0 2.5E+00 1E-1 7E+00 1E+02 2E+2 3E+2 3.35\n",
    "commas and quotes": 'full_name,epoch_mjd,a,e,i,om,w,ma\n"3 A, B",54800,2.5,.1,7,100,200,300\n',
    "bars": "| id | epoch | a | e | i | Omega | omega | M |\n"
    "|---|---|---|---|---|---|---|---|\n| 3 | 54800 | 2.5 | 0.1 | 7 | 100 | 200 | 300 |\n",
    "semicolons": "id;epoch;a;e;inc;node;peri;M;H\n3;54800;2.5;0.1;7;100;200;300;\n",
    "tabs and names of words": "name\tepoch\ta\te\ti\tnode\tw\tM\nTwo Words\t54800\t2.5\t.1\t7\t100\t200\t300\n",
    "long names": "id,epoch,semi-major axis (AU),eccentricity,inclination (deg),"
    "longitude of ascending node (deg),argument of perihelion (deg),mean anomaly (deg)\n"
    "3,54800,2.5,0.1,7,100,200,300\n",
    "percent comments": "% made up\n% id epoch a e i node argp M\n3 54800 2.5 0.1 7 100 200 300\n% end\n",
    "Fortran exponents": "id epoch a e i node argp M\n3 54800D0 .25D1 1d-1 7D0 1D2 2D2 3D2\n",
    "a title": "Asteroids of the mission\n\nid epoch a e i node argp M\n3 54800 2.5 0.1 7 100 200 300\n",
    "a second line of the header": " X  Name  Epoch  a  e  i  w  Node  M \n"
    " N.  (MJD) (AU) (deg.) (deg.)\n 3 2004 ER21 54800 2.5 0.1 7 200 100 300\n",
    "fixed widths": (
        " Num   Name              Epoch      a          e        i         w        Node        M     Ref\n"
        "------ ----------------- ----- ---------- ---------- --------- --------- --------- --------- ---------\n"
        "     3 Two Words         54800  2.5000000 0.10000000   7.00000 200.00000 100.00000 300.00000 JPL 48\n"
    ),
}


@pytest.mark.parametrize("name", HEADERS)
def test_a_table_is_read_by_the_names_and_units_of_its_header(tmp_path, name):
    catalogue = quietly(tmp_path, HEADERS[name])
    assert len(catalogue) == 1
    assert_allclose(catalogue.elements[0], EXPECTED, rtol=1e-8)
    assert_allclose(catalogue.epoch_mjd2000, 54800 - 51544)


def test_ids_names_and_masses_are_kept(tmp_path):
    assert quietly(tmp_path, HEADERS["the layout of the README"]).extra["mass"].tolist() == [1e9]
    assert quietly(tmp_path, HEADERS["dotted names"]).ids.tolist() == [3]
    assert quietly(tmp_path, HEADERS["commas and quotes"]).names == ("3 A, B",)
    assert quietly(tmp_path, HEADERS["tabs and names of words"]).names == ("Two Words",)
    assert quietly(tmp_path, HEADERS["a second line of the header"]).names == ("2004 ER21",)
    assert quietly(tmp_path, HEADERS["fixed widths"]).names == ("Two Words",)


FAULTS = {
    "unknown unit": ("id epoch a(ly) e i node argp M\n", r"line 1: unit \(ly\) of column a"),
    "unknown angle": ("id epoch a e i(arcsec) node w M\n", r"unit \(arcsec\) .*deg, rad"),
    "unknown epoch": ("id epoch(unix) a e i node w M\n", r"unit \(unix\) .*mjd, jd, mjd2000"),
    "units on a line": (
        "id epoch a e i node argp M\n - MJD AU - rad rad rad rad\n1 54800 2.5 .1 1 1 1 1\n",
        "line 2: units in a line of their own",
    ),
    "no epoch": ("id a e i node argp M\n1 2.5 .1 7 100 200 300\n", "line 1: no column epoch"),
    "comets": ("name epoch q e i node argp tp\n", "no column a, M; comets,"),
    "twice": ("id epoch a sma e i node argp M\n", "columns a and sma are both a"),
    "Julian date": (
        "id epoch(MJD) a e i node argp M\n1 2454800.5 2.5 .1 7 100 200 300\n",
        r"line 2: epoch is '2454800.5'.*is it a Julian date\? then it is MJD 54800$",
    ),
    "decimal comma": (
        "id;epoch;a;e;i;node;argp;M\n1;54800;2,5;0.1;7;100;200;300\n",
        "a is '2,5'; .* with a decimal point",
    ),
    "unknown layout": ("a b c\n1 2 3\n", r"line 1: unknown layout; .*'ID epoch\(MJD\) a\(AU\)"),
    "a zip archive": (b"PK\x03\x04abc", "is a zip archive; expected plain text"),
    "JSON": ('[{"a": 2.5}]', "is JSON"),
    "a web page": ("<!DOCTYPE html>", "web page"),
    "damaged gzip": (gzip.compress(b"abc" * 100)[:-20], "is damaged gzip"),
    "too few cells": ("id,epoch,a,e,i,node,argp,M\n1,2\n", "line 2: 2 columns, expected 8 of"),
    "several epochs of Horizons": (
        "JDTDB, Date, EC, QR, IN, OM, W, Tp, N, MA, TA, A, AD, PR,\n$$SOE\n1,\n2,\n$$EOE\n",
        "2 epochs of one body",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_what_is_not_understood_is_refused_in_one_line(tmp_path, name):
    text, message = FAULTS[name]
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "table.txt"))
    assert "\n" not in str(caught.value)


def test_the_header_that_messages_show_is_read(tmp_path):
    with pytest.raises(InputError) as caught:
        read(tmp_path, "a b c\n")
    header = re.search("'(ID .*)'", str(caught.value))[1]
    catalogue = quietly(tmp_path, f"{header}\n1 54800 2.5 0.1 7 100 200 300\n")
    assert_allclose(catalogue.elements[0], EXPECTED)


PLAIN = "id epoch a e i node argp M\n"


def test_angles_that_look_like_radians_are_asked_about(tmp_path):
    rows = "".join(f"{k} 54800 2.5 0.1 0.{k} 6.1 3.{k} 5.2\n" for k in range(1, 6))
    one_warning(tmp_path, PLAIN + rows, r"within 0 to 2 pi and are read as degrees.*i\(rad\)")
    quietly(tmp_path, PLAIN.replace("i node", "i(deg) node(deg)") + rows)
    quietly(tmp_path, PLAIN + rows + "9 54800 2.5 0.1 0.1 6.4 3.1 5.2\n")


def test_epochs_under_a_header_that_is_silent(tmp_path):
    text = PLAIN + "3 2454800.5 2.5 0.1 7 100 200 300\n"
    catalogue = one_warning(tmp_path, text, "read as Julian dates: 2454800.5 is MJD 54800")
    assert_array_equal(catalogue.epoch_mjd2000, [54800 - 51544])
    text = PLAIN + "3 3256 2.5 0.1 7 100 200 300\n"
    one_warning(tmp_path, text, r"epoch 3256 is read as MJD, 1867-10-17; .*epoch\(MJD2000\)")
    with pytest.raises(InputError, match="line 3: epoch is '54800'"):
        read(tmp_path, PLAIN + "3 2454800.5 2.5 0.1 7 1 2 3\n4 54800 2.5 0.1 7 1 2 3\n")


def test_rows_without_an_element_are_left_out_and_counted(tmp_path):
    text = "id,epoch,a,e,i,om,w,ma\n1,54800,2.5,0.1,7,100,200,\n2,54800,2.5,0.1,7,100,200,300\n"
    assert one_warning(tmp_path, text, "1 of 2 rows lack an element").ids.tolist() == [2]


def test_names_in_another_encoding_do_not_lose_the_table(tmp_path):
    text = "id epoch a e i argp node M name\n1 54800 2.5 0.1 7 200 100 300 Hürda Müller\n"
    catalogue = one_warning(tmp_path, text.encode("cp1252"), "line 2: is not UTF-8")
    assert catalogue.names == ("Hürda Müller",)
    assert_allclose(catalogue.elements[0], EXPECTED)
    assert quietly(tmp_path, text.encode()).names == ("Hürda Müller",)
    assert quietly(tmp_path, text.encode("utf-16")).names == ("Hürda Müller",)
    assert quietly(tmp_path, codecs.BOM_UTF8 + text.encode()).names == ("Hürda Müller",)


def test_packed_tables_are_read(tmp_path):
    text = HEADERS["without mass"].encode()
    assert_allclose(read(tmp_path, gzip.compress(text)).elements[0], EXPECTED)


def mpc_line(packed, magnitude, epoch, motion, a, name):
    orbit = (
        f"{packed:7} {magnitude:11} {epoch} 300.00000  200.00000  100.00000    7.00000  0.1000000 "
        f"{motion:>11} {a:>11}  0 MPO492748  6751 115 1801-2019 0.60 M-v 30h Williams   0000"
    )
    return f"{orbit:166}{name:28}20190915\n"


MPCORB = (
    "MINOR PLANET CENTER ORBIT DATABASE\n\nDes'n  H  G  Epoch  M  Peri.  Node  Incl.  e  n  a\n"
    + 120 * "-"
    + "\n"
    + mpc_line("00003", " 3.4   0.15", "K205V", "0.21406009", "2.5000000", "     (3) Someone")
    + mpc_line("A0001", "", "K194R", "0.21406009", "2.5000000", "")
    + "\n"
    + mpc_line("J94W01Y", "18.9   0.15", "I95AV", "", "2.5000000", "         1994 WY1")
    + mpc_line("~0000", "18.9", "K205V", "0.21406009", "", "(620000)")
)


def test_the_orbits_of_the_minor_planet_center_are_read(tmp_path):
    catalogue = one_warning(tmp_path, MPCORB, "1 of 4 rows lack an element")
    assert_array_equal(catalogue.ids, [3, 100001, 50_000_003])
    assert catalogue.names == ("3 Someone", "A0001", "1994 WY1")
    assert_allclose(catalogue.elements, [EXPECTED] * 3)
    assert_array_equal(catalogue.epoch_mjd2000 + 51544, [59000, 58600, 13497])
    with pytest.raises(InputError, match="line 10: no orbit in the format of MPCORB"):
        read(tmp_path, MPCORB + "00004 cut\n")


def test_elements_of_horizons_are_read(tmp_path):
    text = (
        "Target body name: 3 Someone (A801 AA)      {source: JPL#48}\nOutput units    : AU-D, deg\n"
        "  EPOCH=  2458849.5 ! 2020-Jan-01.00 (TDB)\n*****\n"
        "   JDTDB,  Calendar Date (TDB),  EC,  QR,  IN,  OM,  W,  Tp,  N,  MA,  TA,  A,  AD,  PR,\n"
        "*****\n$$SOE\n2454800.5, A.D. 2008-Nov-30, 0.1, 2.25, 7, 100, 200, 2.4E6, .2, 300, 9, 2.5, 2, 3,\n"
        "$$EOE\nCoordinate system description: a, b\n"
    )
    catalogue = quietly(tmp_path, text)
    assert catalogue.names == ("3 Someone (A801 AA)",)
    assert_allclose(catalogue.elements[0], EXPECTED)
    assert catalogue.epoch_mjd2000.tolist() == [54800 - 51544]
    with pytest.raises(InputError, match="expected AU-D, deg"):
        read(tmp_path, text.replace("AU-D", "KM-S"))
