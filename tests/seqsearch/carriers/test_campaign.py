"""A small campaign in a synthetic belt: a mother ship, three probes, a folder that can go on."""

import json

import pytest

from seqsearch import read_tour
from seqsearch.budget import Limits
from seqsearch.commands.cli import main
from seqsearch.problems.problem_file import read_config
from seqsearch.runs.carrier_run import STATE, begin_carrier
from seqsearch.runs.fleet import probe_paths
from seqsearch.tours.carrier.carrier_files import CARRIER, read_carrier
from seqsearch.tours.carrier.path import fly_carrier
from tests.helpers.carriers import BELT_PROBLEM, TINY_CAMPAIGN

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("carrier")
    file = folder / "problem.toml"
    file.write_text(BELT_PROBLEM)
    out = folder / "run"
    assert begin_carrier(read_config(str(file)), out, 3, Limits(workers=1), TINY_CAMPAIGN) == 0
    return out


def test_probes_leave_the_mother_ship_and_come_back_to_her(run):
    path = fly_carrier(read_carrier(run / CARRIER))
    tours = [read_tour(file) for file in probe_paths(run)]
    assert len(tours) == 3
    assert path.propellant_left_kg >= 0.0
    for number, tour in enumerate(tours, 1):
        release, capture = path.carrier.release(number), path.carrier.capture(number)
        assert release is not None
        assert capture is not None
        assert release.t_mjd2000 == pytest.approx(tour.legs[0].t_dep_mjd2000, abs=1e-6)
        assert capture.t_mjd2000 == pytest.approx(tour.legs[-1].t_arr_mjd2000, abs=1e-6)
        assert capture.mass_kg == pytest.approx(tour.m_final_kg, abs=1e-6)
        assert capture.t_mjd2000 - release.t_mjd2000 <= 2191.5


def test_the_folder_is_verified_as_a_fleet(run, capsys):
    assert main(["verify", str(run)]) == 0
    assert "on 3 probes" in capsys.readouterr().out


def test_asteroids_are_counted_once(run):
    record = json.loads((run / "fleet.json").read_text())
    visits = [body.id for file in probe_paths(run) for body in read_tour(file).visits]
    assert record["asteroids"] == len(set(visits)) == len(visits)


def test_a_run_without_a_limit_is_complete_and_a_damaged_state_is_an_error(run):
    state = json.loads((run / STATE).read_text())
    assert state["looked"][1] == min(200, len(state["rated"])) > 2
    assert state["looked"][4] == 2
    assert (state["manned"], state["tried"]) == (2, 4)
    (run / STATE).rename(run / "kept")
    (run / STATE).write_text("{}")
    assert main(["resume", str(run)]) == 2
    (run / STATE).unlink()
    (run / "kept").rename(run / STATE)
