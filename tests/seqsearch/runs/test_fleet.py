"""Fleets: disjoint tours, one run folder a probe, and the commands that work on them."""

import json
import shutil
import tomllib
from itertools import combinations

import numpy as np
import pytest

from feasibility import InputError
from seqsearch import read_tour
from seqsearch.commands.cli import main
from seqsearch.problems.problem_file import build_problem, read_config
from seqsearch.runs.fleet import check_disjoint, probe_paths
from tests.helpers.problem_texts import QUICK

PROBLEM = QUICK.replace("synthetic_bodies = 300", "synthetic_bodies = 1500")


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    problem = folder / "fleet.toml"
    problem.write_text(PROBLEM + "\n[fleet]\nprobes = 2\n")
    out = folder / "run"
    options = ["--seed", "1", "--workers", "1", "--time-limit", "12s", "--out", str(out)]
    assert main(["run", str(problem), *options]) == 0
    return out


def test_probes_of_a_fleet_share_no_asteroid(fleet, capsys):
    tours = [read_tour(path) for path in probe_paths(fleet)]
    assert len(tours) == 2
    assert all(tour.legs for tour in tours)
    bodies = [{body.id for body in tour.bodies} for tour in tours]
    assert not any(a & b for a, b in combinations(bodies, 2))
    record = json.loads((fleet / "fleet.json").read_text())
    assert record["asteroids"] == sum(len(ids) for ids in bodies)
    assert main(["verify", str(fleet)]) == 0
    assert "no asteroid on two probes" in capsys.readouterr().out


def test_each_probe_is_a_run_of_its_own(fleet):
    first = {body.id for body in read_tour(fleet / "probe-1" / "sequence.json").bodies}
    config = tomllib.loads((fleet / "probe-2" / "config.toml").read_text())
    assert set(config["catalogue"]["exclude_ids"]) == first
    assert main(["verify", str(fleet / "probe-2")]) == 0


def test_a_shared_asteroid_fails_the_verification(fleet, tmp_path, capsys):
    copy = tmp_path / "copy"
    shutil.copytree(fleet, copy)
    shutil.copy(copy / "probe-1" / "sequence.json", copy / "probe-2" / "sequence.json")
    assert not check_disjoint([read_tour(path) for path in probe_paths(copy)]).passed
    assert main(["verify", str(copy)]) == 1
    assert "NOT verified" in capsys.readouterr().out


def test_polish_replaces_the_sequence_only_if_better_and_keeps_the_original(tmp_path, capsys):
    problem = tmp_path / "one.toml"
    # Flight times from a coarse grid: there is time to gain.
    problem.write_text(PROBLEM)
    run = tmp_path / "run"
    assert main(["run", str(problem), "--seed", "1", "--workers", "1", "--out", str(run)]) == 0
    searched = (run / "sequence.json").read_bytes()
    options = ["--time-limit", "4s", "--seed", "2", "--workers", "1"]
    assert main(["polish", str(run), *options]) == 0
    before, after = read_tour(run / "sequence.search.json"), read_tour(run / "sequence.json")
    assert (run / "sequence.search.json").read_bytes() == searched
    assert (after.n_asteroids, -after.duration_days) > (before.n_asteroids, -before.duration_days)
    report = json.loads((run / "polish.json").read_text())
    assert report["replaced"]
    assert report["steps"][-1]["duration_days"] == after.duration_days
    assert main(["verify", str(run)]) == 0
    # Polished again for no time at all: nothing is better, nothing is replaced.
    polished = (run / "sequence.json").read_bytes()
    assert main(["polish", str(run), "--time-limit", "0.001s", "--workers", "1"]) == 0
    assert (run / "sequence.json").read_bytes() == polished
    assert (run / "sequence.search.json").read_bytes() == searched
    assert not json.loads((run / "polish.json").read_text())["replaced"]
    capsys.readouterr()


def test_excluded_bodies_are_not_in_the_problem(tmp_path):
    path = tmp_path / "less.toml"
    path.write_text(PROBLEM)
    everything = build_problem(read_config(str(path)))
    gone = everything.catalogue.ids[[3, 5, 8]]
    line = f"exclude_ids = {gone.tolist()}\n"
    path.write_text(PROBLEM.replace("synthetic_bodies", line + "synthetic_bodies"))
    less = build_problem(read_config(str(path)))
    assert set(less.catalogue.ids) == set(everything.catalogue.ids) - set(gone)
    kept = less.catalogue.rows_of(everything.catalogue.ids[10])
    assert np.array_equal(less.catalogue.elements[kept], everything.catalogue.elements[[10]])


def test_excluding_every_start_or_an_unknown_body_is_said(tmp_path):
    path = tmp_path / "bad.toml"
    catalogue = "exclude_ids = {}\nsynthetic_bodies"
    path.write_text(PROBLEM.replace("synthetic_bodies", catalogue.format("[99999999]")))
    with pytest.raises(InputError, match="99999999"):
        build_problem(read_config(str(path)))
    text = PROBLEM.replace("synthetic_bodies", catalogue.format("[1]"))
    path.write_text(text.replace("[mission]", "[mission]\nstart_ids = [1]"))
    with pytest.raises(InputError, match="start_ids"):
        build_problem(read_config(str(path)))


def test_polishing_what_is_no_run_is_said(tmp_path, capsys):
    assert main(["polish", str(tmp_path)]) == 2
    assert "sequence.json" in capsys.readouterr().err
