"""`seqsearch fly`: a sequence that the user names, flown whole or broken with a reason."""

import csv
from pathlib import Path

import numpy as np
import pytest

from feasibility import InputError
from seqsearch import load_problem, read_tour, verify_tour
from seqsearch.commands.cli import main
from seqsearch.core.nodes import Nodes
from seqsearch.problems.problem_file import build_problem, read_config, with_sequence
from tests.helpers.problem_texts import GOOD, QUICK

SHARED = Path(__file__).parents[4] / "shared"
TABLE = SHARED / "gtoc" / "official" / "GTOC7-DATA.txt"
JPL = SHARED / "legs" / "gtoc7_jpl_36.csv"
BELT = QUICK.replace("synthetic_bodies = 300", "synthetic_bodies = 1500")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A problem file and a tour that a search found for it."""
    folder = tmp_path_factory.mktemp("found")
    problem = folder / "quick.toml"
    problem.write_text(BELT)
    assert main(["run", str(problem), "--workers", "1", "--out", str(folder / "run")]) == 0
    return problem, read_tour(folder / "run" / "sequence.json")


def test_a_sequence_that_a_search_found_is_flown_in_no_more_time(found, tmp_path, capsys):
    problem, tour = found
    ids = [str(body.id) for body in tour.bodies]
    out = tmp_path / "fly"
    arguments = ["--problem", str(problem), "--workers", "1", "--out", str(out)]
    assert main(["fly", *ids, *arguments]) == 0
    flown = read_tour(out / "sequence.json")
    assert [str(body.id) for body in flown.bodies] == ids
    assert flown.duration_days <= tour.duration_days
    assert "the whole sequence: " in capsys.readouterr().out
    assert main(["verify", str(out)]) == 0
    assert verify_tour(flown).passed
    # Polishing must leave the bodies alone, whatever the time limit.
    assert main(["polish", str(out), "--time-limit", "5s", "--workers", "1"]) == 0
    assert [str(body.id) for body in read_tour(out / "sequence.json").bodies] == ids


def test_the_file_may_name_the_sequence_and_run_flies_it(found, tmp_path):
    problem, tour = found
    ids = [body.id for body in tour.bodies[:2]]
    file = tmp_path / "mine.toml"
    file.write_text(problem.read_text().replace("[mission]", f"[mission]\nsequence = {ids}"))
    for command in (["run", str(file)], ["fly", "--problem", str(file)]):
        out = tmp_path / command[0]
        assert main([*command, "--workers", "1", "--out", str(out)]) == 0
        assert [body.id for body in read_tour(out / "sequence.json").bodies] == ids


def test_where_a_sequence_breaks_is_said(found, tmp_path, capsys):
    problem, tour = found
    catalogue = load_problem(str(problem)).catalogue
    distance = np.abs(catalogue.elements[:, 0] - tour.bodies[1].a_m)
    far = int(catalogue.ids[np.argmax(distance)])
    ids = [str(tour.bodies[0].id), str(tour.bodies[1].id), str(far)]
    out = tmp_path / "fly"
    arguments = ["--problem", str(problem), "--workers", "1", "--out", str(out)]
    assert main(["fly", *ids, *arguments]) == 1
    last = capsys.readouterr().out.strip().splitlines()[-1]
    assert last.startswith(f"flown to 2 of 3; breaks at leg 2, {ids[1]} -> {far}: ")
    assert "m*/m0 is 0." in last
    assert len(read_tour(out / "sequence.json").legs) == 1
    assert main(["verify", str(out)]) == 0


@pytest.mark.parametrize(
    ("ids", "message"),
    [
        ([], "no sequence; expected ids, or sequence ="),
        ([1], "sequence has one body, expected two or more different ids"),
        ([1, 2, 1], "sequence has 1 more than once"),
        ([1, 999999], "id 999999 is not in"),
    ],
)
def test_bad_sequences_are_one_line(ids, message, tmp_path, capsys):
    problem = tmp_path / "mine.toml"
    problem.write_text(GOOD)
    arguments = [*map(str, ids), "--problem", str(problem), "--out", str(tmp_path / "fly")]
    assert main(["fly", *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert "\n" not in error


def test_a_sequence_and_rules_of_a_competition_do_not_go_together(tmp_path):
    config = with_sequence(read_config("gtoc5"), (1, 2))
    catalogue = load_problem("demo").catalogue
    with pytest.raises(InputError, match=r"a sequence and a table \[gtoc5\]"):
        build_problem(config, catalogue)


def test_only_the_next_body_of_the_sequence_may_be_visited(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(GOOD.replace("[mission]", "[mission]\nsequence = [7, 3, 11]"))
    problem = load_problem(str(file))
    rows = problem.catalogue.rows_of([7, 3, 11])
    assert len(problem.catalogue) == 3
    assert problem.start_rows().tolist() == [rows[0]]
    nodes = Nodes.at_start(rows, np.zeros(3), np.ones(3))
    nodes.depth[:] = [0, 1, 2]
    targets = np.tile(np.arange(3), (3, 1))
    allowed = problem.may_visit(nodes, targets)
    assert [np.flatnonzero(row).tolist() for row in allowed] == [[rows[1]], [rows[2]], []]


@pytest.mark.slow
@pytest.mark.skipif(not JPL.exists(), reason="the published tours are not at hand")
@pytest.mark.parametrize("probe", ["1", "2", "3"])
def test_published_chains_are_flown(probe, tmp_path):
    rows = [row for row in csv.DictReader(JPL.open()) if row["probe"] == probe]
    ids = [row["asteroid_id"] for row in rows if row["asteroid_id"].isdigit()]
    arguments = ["--problem", "gtoc7", "--catalogue", str(TABLE), "--out", str(tmp_path / "fly")]
    assert main(["fly", *ids, *arguments]) == 0
    assert main(["verify", str(tmp_path / "fly")]) == 0
