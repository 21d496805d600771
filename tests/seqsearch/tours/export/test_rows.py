import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from feasibility import InputError
from seqsearch.tours.export import Flight, make_exporter
from seqsearch.tours.export.rows import read_rows, write_rows
from seqsearch.tours.paths import impulsive_trajectory
from seqsearch.tours.trajectory import Phase, Trajectory
from tests.helpers.handmade_tours import handmade_rows, handmade_tour

ROW = "60000 1e8 2e8 3e7 10 20 1 2000 0 0 0\n"
LATER = "60001 1e8 2e8 3e7 10 20 1 1999 0 0 0\n"
GOOD = "# phase 1: EARTH -> 7\n" + ROW + LATER


def _read(tmp_path, text):
    file = tmp_path / "P1.TXT"
    file.write_text(text)
    return read_rows(file)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 9))
def test_numbers_come_back_as_they_were(tmp_path_factory, seed, n):
    rng = np.random.default_rng(seed)
    thrust = rng.uniform(-0.3, 0.3, (n, 3))
    thrust[-1] = 0.0
    phase = Phase(
        "EARTH", "12", np.sort(rng.uniform(0, 2e4, n)), rng.normal(0, 1e11, (n, 6)),
        rng.uniform(500, 4000, n), thrust,
    )  # fmt: skip
    file = tmp_path_factory.mktemp("rows") / "x.rows"
    write_rows(Trajectory((phase,), continuous=True), file, title="a title -> b")
    (back,) = read_rows(file).phases
    assert (back.start, back.end) == ("EARTH", "12")
    # MJD has microseconds; a kilometre written is the kilometre read.
    np.testing.assert_allclose(back.t_mjd2000, phase.t_mjd2000, rtol=0, atol=1e-11)
    np.testing.assert_allclose(back.states, phase.states, rtol=3e-16)
    np.testing.assert_array_equal(back.mass_kg, phase.mass_kg)
    np.testing.assert_array_equal(back.thrust_n, phase.thrust_n)


def test_the_layout_is_that_of_competitions(tmp_path):
    tour = handmade_tour()
    make_exporter("rows").write(Flight(tour, handmade_rows(tour)), tmp_path / "P1.TXT")
    lines = (tmp_path / "P1.TXT").read_text().splitlines()
    heads = [line for line in lines if line.startswith("# phase")]
    assert heads == ["# phase 1: 11 -> 12", "# phase 2: 12 -> 13", "# phase 3: 13 -> 14"]
    rows = [line.split() for line in lines if not line.startswith("#")]
    assert {len(row) for row in rows} == {11}
    first = [float(cell) for cell in rows[0]]
    assert first[0] == tour.legs[0].t_dep_mjd2000 + 51544.0
    assert 1e8 < np.linalg.norm(first[1:4]) < 1e9
    assert 5 < np.linalg.norm(first[4:7]) < 50
    assert first[7] == 2000.0


def test_impulses_are_no_rows(tmp_path):
    tour = handmade_tour()
    with pytest.raises(InputError, match="refine it first"):
        make_exporter("rows").write(Flight(tour, impulsive_trajectory(tour)), tmp_path / "x")
    assert not list(tmp_path.iterdir())


def test_comments_and_blank_lines_do_not_matter(tmp_path):
    text = "# mine\n\n" + GOOD.replace(ROW, ROW + "  # a comment\n\n") + "# phases end here\n"
    assert len(_read(tmp_path, text).phases[0]) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no line '# phase 1"),
        (ROW, "line 1: a row before"),
        ("# phase 1: EARTH\n" + ROW, "line 1: .*expected '# phase 1: FROM -> TO'"),
        ("# phase 2: EARTH -> 7\n" + ROW, "line 1: phase 2, expected phase 1"),
        ("# phase 1: EARTH -> 7\n" + ROW, "line 1: phase EARTH -> 7 has 1 rows"),
        (GOOD.replace(" 0\n", "\n", 1), "line 2: 10 columns, expected 11"),
        (GOOD.replace("2e8", "x", 1), "line 2: 'x', expected a number"),
        (GOOD.replace("2e8", "nan", 1), "line 2: a number that is not finite"),
        (GOOD.replace("1999", "-1"), "line 3: mass -1 kg"),
        (GOOD.replace("60001", "59999"), "line 3: MJD 59999 after 60000"),
        (GOOD.replace("1999 0", "1999 0.1"), "thrust in the last row"),
        (GOOD + GOOD.replace("phase 1", "phase 2"), "expected them in order"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as caught:
        _read(tmp_path, text)
    assert "P1.TXT" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_text_is_refused(tmp_path):
    (tmp_path / "x").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match="not a text file"):
        read_rows(tmp_path / "x")
    with pytest.raises(InputError, match="cannot be read"):
        read_rows(tmp_path / "missing")
