import json

import numpy as np
import pytest

from feasibility import InputError
from feasibility.constants import AU, MJD2000_MJD
from seqsearch.commands.cli import main
from seqsearch.tours.tour_files import read_tour, to_json
from seqsearch.tours.trajectory_files import ROWS, SUMMARY, read_trajectory
from tests.helpers.handmade_tours import handmade_run, handmade_tour

PROBLEM = """
[problem]
name = "handmade"
[spacecraft]
wet_mass_kg = 2000
dry_mass_kg = 800
thrust_n = 0.3
isp_s = 3000
[mission]
first_departure_mjd = [59444, 59644]
max_duration_days = 1500
min_stay_days = 30
[catalogue]
file = "{file}"
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = handmade_run(tmp_path_factory.mktemp("runs") / "hand")
    assert main(["refine", str(folder), "-q"]) == 0
    return folder


@pytest.fixture
def problem(run, tmp_path):
    lines = ["ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)"]
    for body in read_tour(run / "sequence.json").bodies:
        angles = (body.i_rad, body.node_rad, body.argp_rad, body.mean_anomaly_rad)
        numbers = (body.epoch_mjd2000 + MJD2000_MJD, body.a_m / AU, body.e, *np.degrees(angles))
        lines.append(f"{body.id} " + " ".join(f"{number:.17g}" for number in numbers))
    (tmp_path / "table.txt").write_text("\n".join(lines) + "\n")
    file = tmp_path / "problem.toml"
    file.write_text(PROBLEM.format(file=tmp_path / "table.txt"))
    return file


def test_the_folder_has_rows_and_what_changed(run):
    tour = read_tour(run / "sequence.json")
    trajectory = read_trajectory(run, tour)
    assert trajectory.continuous
    assert len(trajectory.phases) == len(tour.legs)
    summary = json.loads((run / SUMMARY).read_text())
    assert len(summary["legs"]) == 3
    assert summary["provenance"]["versions"]


def test_the_exported_file_is_verified_by_the_problem_alone(run, problem, tmp_path, capsys):
    out = tmp_path / "P1.TXT"
    assert main(["export", str(run), "--to", "rows", "--out", str(out)]) == 0
    fine = ["--position-tolerance", "1", "--velocity-tolerance", "1e-3"]
    verify = ["verify", str(out), "--continuous", "--problem", str(problem)]
    assert main([*verify, *fine]) == 0
    capsys.readouterr()
    assert main([*verify, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verified"]
    out.write_text(out.read_text().replace("11 -> 12", "13 -> 12"))
    assert main(verify) == 1
    assert "FAIL  position at each departure" in capsys.readouterr().out


def test_rows_in_a_run_are_verified_and_belong_to_its_tour(run, problem, capsys):
    assert main(["verify", str(run), "--continuous", "--problem", str(problem)]) == 0
    assert "flies the tour of sequence.json" in capsys.readouterr().out


def test_a_tour_that_changed_has_no_trajectory(tmp_path, problem, capsys):
    folder = handmade_run(tmp_path / "hand")
    assert read_trajectory(folder, read_tour(folder / "sequence.json")) is None
    assert main(["refine", str(folder)]) == 0
    (folder / "sequence.json").write_text(to_json(handmade_tour(tof_days=121.0)))
    with pytest.raises(InputError, match="refined from another tour"):
        read_trajectory(folder, read_tour(folder / "sequence.json"))
    assert main(["verify", str(folder), "--continuous", "--problem", str(problem)]) == 1
    assert "FAIL  flies the tour" in capsys.readouterr().out


def test_rows_of_an_interrupted_writing_are_noticed(tmp_path):
    folder = handmade_run(tmp_path / "hand")
    assert main(["refine", str(folder), "-q"]) == 0
    tour = read_tour(folder / "sequence.json")
    (folder / ROWS).write_text((folder / ROWS).read_text() + "# later\n")
    with pytest.raises(InputError, match="refine again"):
        read_trajectory(folder, tour)
    (folder / SUMMARY).write_text("{")
    with pytest.raises(InputError, match="not a complete"):
        read_trajectory(folder, tour)


def test_what_is_missing_is_said_in_one_line(tmp_path, capsys):
    assert main(["refine", str(tmp_path / "nowhere")]) == 2
    assert "no such run folder" in capsys.readouterr().err
    folder = handmade_run(tmp_path / "hand")
    assert main(["verify", str(folder), "--continuous"]) == 2
    assert "refine the tour first" in capsys.readouterr().err
    assert main(["export", str(folder), "--to", "rows", "--out", str(tmp_path / "x")]) == 2
    assert "refine it first" in capsys.readouterr().err
    (tmp_path / "y").write_text("# phase 1: 1 -> 2\n60000 1 0 0 0 1 0 9 0 0 0\n" * 2)
    assert main(["verify", str(tmp_path / "y"), "--continuous"]) == 2
    assert main(["refine", str(folder), "--time-price", "-1"]) == 2
    assert "time price" in capsys.readouterr().err
