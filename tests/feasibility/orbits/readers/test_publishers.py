"""Bodies in the formats of their publishers: what is written is read back, damage is refused."""

import gzip
import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from feasibility.errors import InputError
from feasibility.orbits import read_catalogue
from feasibility.orbits.readers.packed import designation, mjd_of
from feasibility.orbits.tables import read_bodies
from tests.helpers import publishers
from tests.helpers.publishers import FIXED, FORMATS, ONE_BODY, Body, rounded

ANGLES = ("i", "node", "argp", "m")


def written(folder, text, name="table"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def angle(top):
    return st.floats(0.0, top).map(lambda x: round(x, 5))


@st.composite
def bodies(draw, most=4):
    numbers = draw(st.lists(st.integers(1, 999_999), min_size=1, max_size=most, unique=True))
    return [
        rounded(
            Body(
                number=number,
                name=draw(st.sampled_from(["Ceres", "A B", "1999 AB12", "Zoë"])),
                epoch=float(draw(st.integers(50_000, 62_000))),
                a=draw(st.floats(0.5, 40.0)),
                e=draw(st.floats(0.0, 0.99)),
                i=draw(angle(179.9)),
                node=draw(angle(359.9)),
                argp=draw(angle(359.9)),
                m=draw(angle(359.9)),
                h=draw(st.integers(-100, 3000)) / 100,
            ),
            a=7,
            e=7,
        )
        for number in numbers
    ]


@settings(max_examples=40)
@given(st.sampled_from(list(FORMATS)), bodies(), st.booleans())
def test_what_a_publisher_writes_is_read_back_to_the_last_digit(
    tmp_path_factory, label, many, packed
):
    many = many[:1] if label in ONE_BODY else many
    text = FORMATS[label](many).encode()
    folder = tmp_path_factory.getbasetemp()
    table = read_bodies(written(folder, gzip.compress(text) if packed else text))
    assert table.label == label
    assert_array_equal(table.orbits, [body.orbit for body in many])
    assert_array_equal(table.ids, [body.number for body in many])
    assert not table.left_out
    if "H" in table.extra:
        assert_array_equal(table.extra["H"], [body.h for body in many])


@settings(max_examples=20)
@given(st.sampled_from(list(FIXED)), bodies())
def test_tables_of_fixed_columns(tmp_path_factory, label, many):
    many = [replace(body, name="1999 AB12") for body in many]
    table = read_bodies(written(tmp_path_factory.getbasetemp(), FIXED[label](many)))
    assert_array_equal(table.orbits, [body.orbit for body in many])
    assert_array_equal(table.extra["H"], [body.h for body in many])
    assert all(name.endswith("1999 AB12") for name in table.names)


@settings(max_examples=20)
@given(bodies())
def test_vectors_become_the_elements_from_which_they_are(tmp_path_factory, many):
    many = [replace(b, i=max(b.i, 0.1), e=max(b.e, 1e-3)) for b in many]
    path = written(tmp_path_factory.getbasetemp(), publishers.horizons_vectors(many))
    table = read_bodies(path)
    assert_allclose(table.orbits[:, :3], [body.orbit[:3] for body in many], rtol=1e-9)
    here, there = read_catalogue(path).states(9000.0), publishers.plain(many)
    other = read_catalogue(written(tmp_path_factory.getbasetemp(), there)).states(9000.0)
    assert_allclose(here, other, rtol=1e-6, atol=1.0)


def test_comets_on_ellipses_are_read_and_the_others_counted(tmp_path):
    comets = [
        Body(1, "Halley", a=17.8, e=0.967),
        Body(2, "Gone", e=1.0002),
        Body(67, "C-G", e=0.6),
    ]
    table = read_bodies(written(tmp_path, publishers.comet(comets)))
    assert table.names == ("1P/Halley", "67P/C-G")
    kept = [comets[0], comets[2]]
    assert_allclose(table.orbits[:, 0], 59000.0)
    assert_allclose(table.orbits[:, 1:6], [body.orbit[1:6] for body in kept], rtol=1e-5)
    assert_allclose(table.orbits[:, 6], [body.m for body in kept], atol=1e-4)
    assert table.left_out_line() == "1 of 3 left out: 1 with e >= 1 (2P/Gone)"
    query = {
        "fields": ["full_name", "epoch", "q", "e", "i", "om", "w", "tp"],
        "data": [["1P/Halley", "2459000.5", "1", "0.5", "7", "100", "200", "2458900.5"]],
    }
    orbit = read_bodies(written(tmp_path, json.dumps(query))).orbits[0]
    assert_allclose(orbit[:3], [59000.0, 2.0, 0.5])
    assert_allclose(orbit[6], 100 * 0.9856076686 / 2**1.5, rtol=1e-6)


@pytest.mark.parametrize("label", ["MPCORB", "MPC extended JSON", "SBDB query", "CSV", "GTOC12"])
def test_open_orbits_are_kept_out_counted_and_said(tmp_path, label):
    many = [Body(1), Body(2, "Open", e=1.2), Body(4, "Epoch", epoch=58000.0)]
    path = written(tmp_path, FORMATS[label](many))
    with pytest.warns(UserWarning, match="1 of 3 rows .* 1 with e >= 1") as caught:
        catalogue = read_catalogue(path)
    assert len([w for w in caught if "left out" in str(w.message)]) == 1
    assert_array_equal(catalogue.ids, [1, 4])
    assert_array_equal(catalogue.epoch_mjd2000, [59000 - 51544, 58000 - 51544])


def test_comets_from_far_away_do_not_lose_the_table(tmp_path):
    many = [Body(1), Body(2, a=20_000.0, e=0.9999)]
    for label in ("CSV", "SBDB query", "GTOC12"):
        table = read_bodies(written(tmp_path, FORMATS[label](many)))
        assert table.ids.tolist() == [1]
        assert "1 with a semi-major axis outside 0.001 to 10 000 AU" in table.left_out_line()


def test_designations_are_unpacked():
    known = {
        "J95X00A": "1995 XA",
        "J95X01L": "1995 XL1",
        "J98SA8Q": "1998 SQ108",
        "K07Tf8A": "2007 TA418",
        "PLS2040": "2040 P-L",
        "T3S4101": "4101 T-3",
        "_QC0000": "2026 CA620",
        "_QC0aEM": "2026 CZ6190",
        "_QCzzzz": "2026 CL591673",
    }
    assert {packed: designation(packed) for packed in known} == known
    assert mjd_of("K205V") == 59000.0
    assert np.isnan([mjd_of(text) for text in ("K20 V", "K202V", "X205V", "")]).all()


def test_numbered_bodies_have_their_number_and_others_one_of_their_row(tmp_path):
    lines = [
        publishers.mpc_line(Body(5, h=None)),
        publishers.mpc_line(Body(619_999, g=None)),
        publishers.mpc_line(Body(620_000, "Tilde")),
        publishers.mpc_line(Body(name="2026 CZ6190"), "_QC0aEM"),
        publishers.mpc_line(Body(name=""), "K07Tf8A"),
        publishers.mpc_line(Body(15_396_335)),
    ]
    table = read_bodies(written(tmp_path, "\n".join(lines)))
    expected = [5, 619_999, 620_000, 50_000_004, 50_000_005, 15_396_335]
    assert_array_equal(table.ids, expected)
    assert table.names[2:5] == ("620000 Tilde", "2026 CZ6190", "2007 TA418")
    assert np.isnan(table.extra["H"][0])
    assert np.isnan(table.extra["G"][1])
    assert table.extra["neo"].all()
    assert table.extra["pha"].all()
    short = [line[:120].rstrip() for line in lines]
    assert_array_equal(read_bodies(written(tmp_path, "\r\n".join(short))).orbits, table.orbits)


def test_horizons_in_several_layouts(tmp_path):
    cos, sin = np.cos(np.radians(84381.448 / 3600)), np.sin(np.radians(84381.448 / 3600))
    turn = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    body = Body()
    text = publishers.horizons_vectors(
        [body], lambda s: np.concatenate([turn @ s[:3], turn @ s[3:]])
    )
    text = text.replace("Ecliptic of J2000.0", "ICRF")
    assert_allclose(read_bodies(written(tmp_path, text)).orbits[0], body.orbit, rtol=1e-9)
    old = text.replace(
        "Reference frame : ICRF", "Coordinate systm: Earth Mean Equator and Equinox"
    )
    assert_allclose(read_bodies(written(tmp_path, old)).orbits[0], body.orbit, rtol=1e-9)
    elements = publishers.horizons_elements([body, Body(4, "Other")])
    assert_array_equal(read_bodies(written(tmp_path, elements)).ids, [3, 4])
    long = (
        elements.split("   JDTDB")[0] + "*****\n$$SOE\n2459000.500000000 = A.D. 2020-May-31 TDB\n"
        " EC= 1.0E-01 QR= 2.25E+00 IN= 7.0E+00\n OM= 1.0E+02 W = 2.0E+02 Tp=  2458240.179130943\n"
        " N = 2.1E-01 MA= 3.0E+02 TA= 1.3E+02\n A = 2.5E+00 AD= 2.9E+00 PR= 1.6E+03\n"
        "2459010.500000000 = A.D. 2020-Jun-10 TDB\n EC= 9.0E-01 A = 9.0\n$$EOE\n"
    )
    table = read_bodies(written(tmp_path, long))
    assert_array_equal(table.orbits[0], body.orbit)
    assert table.notes == (": 2 epochs of 3 Someone, of which the first is read, MJD 59000",)
    km = publishers.horizons(
        ("A", "EC", "IN", "OM", "W", "MA"), body, (3.74e8, 0.1, 7, 1, 2, 3), "KM-S, deg"
    )
    assert_allclose(read_bodies(written(tmp_path, km)).orbits[0, 1], 2.5000358, rtol=1e-7)


QUERY = json.loads(publishers.sbdb_query([Body(1), Body(2)]))
LINE = publishers.mpc_line(Body())
VECTORS = publishers.horizons_vectors([Body()])
FAULTS = {
    "MPCORB without a column": (
        f"{LINE}\n{LINE[:8]}{LINE[14:]}\n",
        r"line 2: no orbit .*columns 21 to 25 are .*expected designation, H, G, epoch",
    ),
    "MPCORB first line without columns": (
        f"{LINE[:47] + LINE[58:]}\n{LINE}\n",
        "line 1: no orbit in the format",
    ),
    "MPCORB cut": (f"{LINE}\n{LINE[:95]}", r"line 2: no orbit .*95 characters, expected 202"),
    "MPCORB twice": (f"{LINE}\n{LINE}\n", "line 2: id 3 was given to line 1 already"),
    "MPCORB blank in a number": (LINE.replace("2.5000000", "2.5 00000"), "line 1: no orbit"),
    "MPCORB negative": (LINE.replace("  2.5000000", " -2.5000000"), "line 1: a is -2.5 .*AU"),
    "gzip cut": (gzip.compress(LINE.encode() * 50)[:-30], "damaged gzip"),
    "JSON cut off": (publishers.sbdb_query([Body()])[:-20], "damaged JSON.*cut off"),
    "JSON of two minds": (publishers.mpc_json([Body()]) + "x", "damaged JSON"),
    "no JSON of ours": ('{"a": 1}', "is JSON, but has no fields and data; expected"),
    "list of others": ('[{"name": "x"}]', "is JSON without members Epoch and Peri; expected"),
    "numbers in JSON": ("[1, 2]", "is JSON, but .*; expected"),
    "count": (json.dumps(QUERY | {"count": 3}), "count is 3, but data has 2 rows"),
    "none found": ('{"signature": {}, "count": 0}', "found no bodies"),
    "an error": ('{"message": "invalid query", "code": "400"}', "answered 'invalid query'"),
    "short row": (
        json.dumps(QUERY | {"data": [[1, 2]], "count": 1}),
        "row 1: 2 cells, expected 9",
    ),
    "no field": (
        json.dumps(QUERY | {"fields": ["full_name", *"bcdefgh", "H"]}),
        "no field .*epoch.* expected fields such as",
    ),
    "cell": (
        publishers.sbdb_query([Body(1), Body(2)]).replace('"2.5"', '"2,5"', 1),
        r"row 1 \(1 Someone \(1999 AB1\)\): a is '2,5'; expected a number",
    ),
    "MJD for JD": (
        publishers.mpc_json([Body()]).replace("2459000.5", "59000"),
        r"body 1 \(3 Someone\): Epoch is 59000; expected a Julian date",
    ),
    "twice in JSON": (
        publishers.mpc_json([Body(7), Body(7)]),
        r"body 2 \(7 Someone\): id 7 was given to body 1 \(7 Someone\) already",
    ),
    "inclination": (publishers.mpc_json([Body(i=190.0)]), "body 1 .*: i is 190; expected"),
    "HTML": ("\n<html><body>503 Service Unavailable</body></html>", "web page"),
    "barycentre": (VECTORS.replace("Sun (10)", "SSB (0)"), r"the centre is SSB \(0\); .*Sun"),
    "frame": (VECTORS.replace("Ecliptic of J2000.0", "FK4/B1950"), "reference frame 'FK4"),
    "units of Horizons": (VECTORS.replace("AU-D", "FT-D"), "output units are 'FT-D'; expected"),
    "km as AU": (VECTORS.replace("AU-D", "KM-S"), "AU from the Sun by the units"),
    "aberration": (VECTORS.replace("GEOMETRIC", "LT+S"), "output type 'LT.S states'; expected"),
    "Horizons cut": (VECTORS.partition("$$EOE")[0], r"ends before \$\$EOE"),
    "no vector": (VECTORS.replace(" VZ,", " ZZ,"), "no A, EC, IN, OM, W, MA and no X, Y, Z"),
    "equinoctial": (
        publishers.astdys([Body()]).replace("'KEP'", "'EQU'"),
        "line 3: elem is 'EQU'",
    ),
    "AstDyS cut": (
        publishers.astdys([Body()])[:-110],
        "line 7: . numbers behind a name in quotes",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_damage_is_named_in_one_line(tmp_path, name):
    text, message = FAULTS[name]
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        read_catalogue(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_units_that_the_header_does_not_tell(tmp_path):
    orbit = "54800 373994676.75 0.1 0.1221730476 100 200 300"
    path = written(tmp_path, f"id epoch a e inc node argp M\n3 {orbit}\n")
    catalogue = read_catalogue(path, units={"a": "km", "i": "rad", "node": "deg"})
    assert_allclose(catalogue.elements[0, 2], np.radians(7.0))
    assert_allclose(catalogue.elements[0, 0], 2.5 * 1.49597870691e11, rtol=1e-8)
    for units, message in (
        ({"a": "ly"}, "unit 'ly' of column a is not known|unit .ly. of column a is not known"),
        ({"b": "km"}, "units of 'b', which is no column; columns are id, epoch"),
    ):
        with pytest.raises(InputError, match=message):
            read_catalogue(path, units=units)
    path = written(tmp_path, f"id epoch a(au) e inc node argp M\n3 {orbit}\n")
    with pytest.raises(InputError, match="column a is in au by the header, not in km"):
        read_catalogue(path, units={"a": "km"})
    path = written(tmp_path, LINE)
    with pytest.raises(InputError, match="MPCORB has units of its own"):
        read_catalogue(path, units={"a": "km"})


def mutated(data, rng):
    """Return bytes with a letter changed, some left out or repeated, or the end cut."""
    place = int(rng.integers(len(data)))
    some = int(rng.integers(1, 12))
    kind = rng.integers(5)
    if kind == 0:
        return data[:place] + bytes([int(rng.integers(32, 127))]) + data[place + 1 :]
    if kind == 1:
        return data[:place] + data[place + some :]
    if kind == 2:
        return data[:place] + data[place : place + some] + data[place:]
    if kind == 3:
        return data[:place]
    return data[:place] + rng.bytes(some) + data[place + some :]


def check_mutations(folder, count):
    many = [Body(k, f"Body {k}", h=10.0 + k) for k in range(1, 6)]
    known = {(body.number, body.orbit) for body in many}
    writers = {
        **FORMATS,
        **FIXED,
        "vectors": publishers.horizons_vectors,
        "comets": publishers.comet,
    }
    for label, write in writers.items():
        original = write(many[:1] if label in ONE_BODY else many).encode()
        for k in range(count):
            data = mutated(original, np.random.default_rng([k, len(original)]))
            path = written(folder, data)
            message = f"{path}: read"
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)
                    catalogue = read_catalogue(path)
            except InputError as error:
                message = str(error)
            else:
                assert np.isfinite(catalogue.states(0.0)).all(), (label, k)
                assert len(catalogue) <= len(many) + 1, (label, k, known)
            assert message.startswith(str(path)), (label, k)
            assert "\n" not in message, (label, k)


def test_damaged_files_are_read_or_refused_in_one_line(tmp_path):
    check_mutations(tmp_path, 25)


@pytest.mark.slow
def test_many_damaged_files_are_read_or_refused_in_one_line(tmp_path):
    check_mutations(tmp_path, 1000)


def test_a_line_of_mpcorb_that_lost_or_won_a_letter_is_refused(tmp_path):
    """Columns at other places would be other numbers."""
    for place in range(103):
        for line in (LINE[:place] + LINE[place + 1 :], LINE[:place] + "1" + LINE[place:]):
            path = written(tmp_path, f"{publishers.mpc_line(Body(9))}\n{line}\n")
            message = "line 2"
            try:
                table = read_bodies(path)
            except InputError as error:
                message = str(error)
            else:
                # Blanks before the first digit of the orbit may come and go: the rest moved.
                assert_array_equal(table.orbits[1], Body().orbit, err_msg=f"{place}")
            assert "line 2" in message, place
