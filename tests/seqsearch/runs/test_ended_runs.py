"""Runs of tours that have to end at a body: searched, resumed, verified, polished, refined."""

import json

import numpy as np
import pytest

from feasibility.constants import AU, MJD2000_MJD
from seqsearch.commands.cli import main
from seqsearch.core.ending import ending_of
from seqsearch.problems.registry import builtin_problems
from seqsearch.pruning.mima_predictor import MimaPredictor
from seqsearch.runs.whole_chain import whole_chain
from seqsearch.tours.tour_files import read_tour
from tests.helpers.ended_problems import BODY, MOTHER, round_trip
from tests.helpers.problems import small_problem


def _text():
    """Return the problem of `round_trip` as a file: the same orbit, given by its elements."""
    belt = small_problem().catalogue
    row = belt.rows_of([BODY])[0]
    a, e, *angles = belt.elements[row]
    names = ("i_deg", "node_deg", "argp_deg", "mean_anomaly_deg")
    elements = "".join(
        f"{name} = {value!r}\n"
        for name, value in zip(names, np.degrees(angles).tolist(), strict=True)
    )
    return f"""
[problem]
name = "there and back"
[spacecraft]
wet_mass_kg = 2000
dry_mass_kg = 800
thrust_n = 0.3
isp_s = 3000
[mission]
first_departure_mjd = [59215, 60000]
max_duration_days = 1000
min_stay_days = 30
start_ids = [{MOTHER}]
end_id = {MOTHER}
[[bodies]]
name = "mother"
id = {MOTHER}
a_au = {float(a) / AU!r}
e = {float(e)!r}
{elements}
epoch_mjd = {float(belt.epoch_mjd2000[row]) + MJD2000_MJD!r}
[catalogue]
synthetic_bodies = 1500
synthetic_seed = 3
exclude_ids = [{BODY}]
[search]
pruner = "lambert:1.3,mima2:0.97"
beam_width = 6
starts = 12
start_epochs = 12
neighbours = 25
tof_days_step = 30
solves_per_rank = 150
[search.audit]
per_rank = 0
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A finished run, and its problem file."""
    folder = tmp_path_factory.mktemp("ended")
    (folder / "mine.toml").write_text(_text())
    out = folder / "run"
    assert main(["run", str(folder / "mine.toml"), "--out", str(out), "--workers", "1"]) == 0
    return out


def test_a_run_comes_back_and_is_verified(run, capsys):
    tour = read_tour(run / "sequence.json")
    assert tour.bodies[0].id == tour.bodies[-1].id == MOTHER
    assert tour.n_asteroids == len(tour.bodies) - 2
    assert main(["verify", str(run)]) == 0
    assert "ends at the body asked for" in capsys.readouterr().out


def test_a_tour_that_stays_away_is_not_verified(run, tmp_path, capsys):
    record = json.loads((run / "sequence.json").read_text())
    record["legs"].pop()
    record["bodies"].pop()
    record["score"] = len(record["bodies"]) - 1
    changed = tmp_path / "sequence.json"
    changed.write_text(json.dumps(record))
    assert main(["verify", str(changed), "--problem", str(run / "config.toml")]) == 1
    assert "ends at the body asked for" in capsys.readouterr().out


def test_a_run_that_is_resumed_ends_alike(run, tmp_path):
    out = tmp_path / "again"
    problem = str(run.parent / "mine.toml")
    assert main(["run", problem, "--out", str(out), "--workers", "1"]) == 0
    assert main(["resume", str(out), "--from-rank", "1:1", "--workers", "1"]) == 0
    assert (out / "sequence.json").read_bytes() == (run / "sequence.json").read_bytes()


def test_rows_name_the_orbit_at_both_ends(run):
    assert main(["refine", str(run)]) == 0
    assert main(["verify", str(run), "--continuous"]) == 0
    rows = (run / "trajectory.rows").read_text()
    assert "MOTHER -> " in rows
    assert " -> MOTHER" in rows


def test_a_chain_is_flown_to_its_end_from_its_first_legs(run):
    tour = read_tour(run / "sequence.json")
    sequence = tuple(body.id for body in tour.visits)
    problem = round_trip(BODY, sequence=sequence)
    found = whole_chain(problem, ending_of(problem), tour, sequence, MimaPredictor())
    assert found.lacks == ""
    assert [body.id for body in found.tour.bodies] == [MOTHER, *sequence, MOTHER]


def test_a_chain_that_does_not_fit_says_what_it_lacks(run):
    tour = read_tour(run / "sequence.json")
    sequence = tuple(body.id for body in tour.visits)
    problem = round_trip(BODY, sequence=sequence, max_duration_days=500.0)
    found = whole_chain(problem, ending_of(problem), tour, sequence, MimaPredictor())
    assert found.tour is None
    assert "days instead of 500.0" in found.lacks


def test_a_run_without_a_way_home_says_so_and_can_be_read(tmp_path):
    problem = tmp_path / "short.toml"
    problem.write_text(_text().replace("max_duration_days = 1000", "max_duration_days = 130"))
    out = tmp_path / "run"
    assert main(["run", str(problem), "--out", str(out), "--workers", "1"]) == 0
    assert read_tour(out / "sequence.json").legs == ()
    assert main(["verify", str(out)]) == 1
    assert main(["report", str(out)]) == 0


def test_a_run_that_arrives_with_speed_is_polished_and_verified(tmp_path, capsys):
    problem = tmp_path / "fast.toml"
    problem.write_text(_text() + "[ends]\nlaunch_vinf_km_s = 0.5\narrival_vinf_km_s = 1.0\n")
    out = tmp_path / "run"
    assert main(["run", str(problem), "--out", str(out), "--workers", "1"]) == 0
    assert np.linalg.norm(read_tour(out / "sequence.json").legs[-1].arr_velocity_m_s) > 1.0
    assert main(["polish", str(out), "--workers", "1", "--time-limit", "3s"]) == 0
    assert main(["verify", str(out)]) == 0
    assert "speed at the last arrival" in capsys.readouterr().out


def test_a_run_of_fly_bys_is_not_polished(tmp_path, capsys):
    problem = tmp_path / "passing.toml"
    text = builtin_problems()["passing"].replace("starts = 40", "starts = 4")
    problem.write_text(text.replace("beam_width = 20", "beam_width = 2"))
    out = tmp_path / "run"
    given = [str(problem), "--out", str(out), "--workers", "1", "--max-solves", "20"]
    assert main(["run", *given]) == 0
    capsys.readouterr()
    assert main(["polish", str(out), "--workers", "1"]) != 0
    assert "no tour of rendezvous alone" in capsys.readouterr().err
