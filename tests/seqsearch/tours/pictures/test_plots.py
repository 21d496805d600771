"""Pictures: names, dates and numbers as in the table, orbits and stays, any file format."""

import msgspec
import numpy as np
import pytest
from matplotlib.figure import Figure

from feasibility.constants import AU
from feasibility.errors import InputError
from seqsearch import plot_mass, plot_path, plot_thrust, plot_timeline, plot_tour
from seqsearch.commands.cli import main
from seqsearch.tours.dates import date_of
from seqsearch.tours.pictures.stops import stops
from seqsearch.tours.tour_files import to_json
from tests.helpers.handmade_tours import handmade_tour


def _axes():
    return Figure().add_subplot()


def _texts(axes):
    return [text.get_text() for text in axes.texts]


def test_stops_are_numbered_as_the_legs_are():
    tour = handmade_tour()
    found = stops(tour)
    assert [stop.number for stop in found] == [0, 1, 2, 3]
    assert [stop.body.id for stop in found[1:]] == [leg.to_id for leg in tour.legs]
    assert [stop.stay_days for stop in found] == [None, *([pytest.approx(35.0)] * 2), None]
    # A body that is passed once more has the number of the leg that passes it.
    leg = msgspec.structs.replace(tour.legs[2], to_id=12, arr_velocity_m_s=(500.0, 0.0, 0.0))
    passing = msgspec.structs.replace(tour, bodies=tour.bodies[:3], legs=(*tour.legs[:2], leg))
    assert [(stop.number, stop.body.id) for stop in stops(passing)][2:] == [(2, 13), (3, 12)]
    assert stops(passing)[3].fly_by
    assert stops(msgspec.structs.replace(tour, bodies=(), legs=())) == []


def test_the_path_has_orbits_stays_and_the_numbers_of_the_table():
    tour = handmade_tour()
    axes = _axes()
    plot_path(tour, axes)
    assert _texts(axes) == ["0", "1", "2", "3"]
    # Orbits of four bodies, three legs, four marks, two stays and the Sun.
    assert len(axes.lines) == 4 + 3 + 4 + 2 + 1
    orbit = np.hypot(*axes.lines[0].get_data())
    a_au, e = tour.bodies[0].a_m / AU, tour.bodies[0].e
    assert orbit.max() <= a_au * (1 + e) + 1e-9
    assert np.allclose(axes.lines[0].get_xydata()[0], axes.lines[0].get_xydata()[-1])


def test_the_timeline_has_names_and_dates():
    tour = handmade_tour(names=("Alpha", "Beta", "A name of more than twenty letters", "$x$"))
    axes = _axes()
    plot_timeline(tour, axes)
    assert axes.get_ylim() == (3.6, -0.6)
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels[1] == f"1  Beta  {date_of(tour.legs[0].t_arr_mjd2000)}"
    assert labels[2].startswith("2  A name of more than…  ")
    assert labels[0] == f"0  Alpha  {date_of(tour.t_start_mjd2000)}"
    # Three flights and two stays.
    assert len(axes.patches) == 5
    assert axes.patches[0].get_width() == pytest.approx(tour.legs[0].tof_days)


def test_thrust_and_mass_are_those_of_the_table():
    tour = handmade_tour()
    thrust, mass = _axes(), _axes()
    plot_thrust(tour, thrust)
    plot_mass(tour, mass)
    assert max(thrust.patches[0].get_data().values) == pytest.approx(0.24)
    _, kg = mass.lines[0].get_data()
    assert kg[0] == tour.legs[0].m0_kg
    assert kg[-1] == tour.m_final_kg


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
@pytest.mark.parametrize("names", [("A",), (r"$\frac$", "<b>&", "a\nb\x00", "天王", "")])
def test_any_tour_has_a_picture(tmp_path, kind, names):
    path = tmp_path / f"tour.{kind}"
    plot_tour(handmade_tour(names=names, problem="$"), path)
    first = path.read_bytes()
    assert len(first) > 5000
    plot_tour(handmade_tour(names=names, problem="$"), path)
    assert path.read_bytes() == first, "the same tour gives the same file"
    assert list(tmp_path.iterdir()) == [path]


def test_a_picture_that_cannot_be_written_is_said(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        plot_tour(handmade_tour(), tmp_path / "nowhere" / "tour.png")


def test_the_command_chooses_a_name_by_the_format(tmp_path, capsys):
    (tmp_path / "sequence.json").write_text(to_json(handmade_tour()))
    assert main(["plot", str(tmp_path), "--to", "svg"]) == 0
    assert (tmp_path / "tour.svg").read_bytes().startswith(b"<?xml")
    for wrong in (["--to", "gif"], ["--to", "svg", "--out", "x.png"], ["--out", "x.xyz"]):
        assert main(["plot", str(tmp_path), *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1
