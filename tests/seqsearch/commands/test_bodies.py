"""``seqsearch bodies``: what is read, what is left out, for people and for programs."""

import json

import pytest

from seqsearch.commands.cli import main
from tests.helpers import publishers
from tests.helpers.publishers import Body

MANY = [Body(k, f"Body{k}", h=10.0 + k, a=2.0 + 0.1 * k) for k in range(1, 16)]


@pytest.fixture
def mpcorb(tmp_path):
    path = tmp_path / "MPCORB.DAT"
    blank = publishers.mpc_line(Body(99, "Blank")).replace("  2.5000000", 11 * " ")
    lines = [publishers.mpcorb([*MANY, Body(77, "Open", e=1.0), Body(78, "Far", e=1.1)]), blank]
    path.write_text("".join(lines) + "\n")
    return str(path)


def test_people_see_the_first_bodies_and_what_was_left_out(mpcorb, capsys):
    assert main(["bodies", mpcorb]) == 0
    text = capsys.readouterr().out
    assert f"{mpcorb}: 15 bodies, MPCORB" in text
    assert "1 Body1" in text
    assert "11 Body11" not in text
    assert "and 5 more; --all shows them" in text
    assert (
        "3 of 18 left out: 2 with e >= 1 (77 Open, 78 Far), 1 without semi-major axis (99 Blank)"
        in text
    )
    assert main(["bodies", mpcorb, "--all", "--select", "a < 2.5 and H > 12.5"]) == 0
    text = capsys.readouterr().out
    assert "2 of 15 bodies" in text
    assert "4 Body4" in text
    assert "5 Body5" not in text
    assert "3 of 18 left out" in text


def test_programs_get_plain_numbers(mpcorb, capsys):
    assert main(["bodies", mpcorb, "--json", "--select", "id <= 2"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["format"] == "MPCORB"
    assert record["ids"] == [1, 2]
    assert record["names"] == ["1 Body1", "2 Body2"]
    assert record["epoch_mjd"] == [59000.0, 59000.0]
    assert record["a_au"] == [2.1, 2.2]
    keys = ("e", "i_deg", "node_deg", "argp_deg", "m_deg")
    assert [record[key][0] for key in keys] == [0.1, 7.0, 100.0, 200.0, 300.0]
    assert record["extra"]["H"] == [11.0, 12.0]
    assert (record["left_out"]["count"], record["left_out"]["of"]) == (3, 18)
    assert record["left_out"]["reasons"][0] == {
        "reason": "with e >= 1",
        "count": 2,
        "names": ["77 Open", "78 Far"],
    }


def test_several_files_are_a_list(mpcorb, tmp_path, capsys):
    other = tmp_path / "other"
    other.write_text("id epoch a e i node argp M\n3 54800 2.5 0.1 0.5 100 200 300\n")
    assert main(["bodies", str(other), str(other), "--json", "--units", "i=rad,node=deg"]) == 0
    records = json.loads(capsys.readouterr().out)
    assert [round(record["i_deg"][0], 6) for record in records] == [28.647890] * 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--select", "b > 1"], "no column 'b'; columns are id, epoch, a"),
        (["--units", "i"], "expected COLUMN=UNIT"),
        (["--units", "i=rad"], "units of its own"),
    ],
)
def test_mistakes_are_named(mpcorb, capsys, options, message):
    assert main(["bodies", mpcorb, *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
