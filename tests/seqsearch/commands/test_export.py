"""``seqsearch export``: exit codes, one line for what cannot be done, nothing half written."""

import networkx as nx
import pytest

from feasibility.runtime.atomic import write_text
from seqsearch.commands.cli import main
from seqsearch.tours.tour_files import read_tour, to_json
from seqsearch.tours.trajectory_files import write_trajectory
from tests.helpers.handmade_tours import handmade_rows, handmade_tour
from tests.helpers.problem_texts import QUICK


@pytest.fixture
def tour_file(tmp_path):
    path = tmp_path / "sequence.json"
    write_text(path, to_json(handmade_tour()))
    return path


def _fails(arguments, capsys, *words):
    assert main([str(argument) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    for word in words:
        assert word in captured.err


@pytest.mark.parametrize("kind", ["oem", "stk", "csv", "json"])
def test_a_tour_file_is_exported(tour_file, tmp_path, capsys, kind):
    out = tmp_path / "out"
    assert main(["export", str(tour_file), "--to", kind, "--out", str(out)]) == 0
    assert out.stat().st_size > 10_000
    assert "3 legs, impulses, not refined" in capsys.readouterr().out


def test_what_cannot_be_exported_is_said_in_one_line(tour_file, tmp_path, capsys):
    out = tmp_path / "out"
    formats = ("rows", "oem", "spk", "spk13", "stk", "csv", "json", "graphml")
    _fails(["export", tour_file, "--to", "kml", "--out", out], capsys, "kml", *formats)
    _fails(["export", tour_file, "--to", "graphml", "--out", out], capsys, "checkpoints")
    _fails(["export", tmp_path / "no", "--to", "csv", "--out", out], capsys, "cannot be read")
    _fails(["export", tour_file, "--to", "csv", "--out", tmp_path], capsys, "cannot be written")
    write_text(tour_file, to_json(handmade_tour(names=("Alone",))))
    _fails(["export", tour_file, "--to", "csv", "--out", out], capsys, "no leg", str(tour_file))
    assert not out.exists()


def test_a_refined_tour_is_exported_with_its_thrust(tour_file, tmp_path, capsys):
    tour = read_tour(tour_file)
    write_trajectory(tmp_path, tour, handmade_rows(tour), {})
    out = tmp_path / "out"
    for kind in ("rows", "csv", "oem", "json"):
        assert main(["export", str(tmp_path), "--to", kind, "--out", str(out)]) == 0
        assert "continuous thrust" in capsys.readouterr().out
    assert out.read_text().count("continuous thrust") == 1
    write_text(tour_file, to_json(handmade_tour(tof_days=130.0)))
    _fails(["export", tour_file, "--to", "csv", "--out", out], capsys, "another tour")


def test_the_search_tree_is_a_graph(tmp_path, capsys):
    problem, run = tmp_path / "quick.toml", tmp_path / "run"
    problem.write_text(QUICK.replace("synthetic_bodies = 300", "synthetic_bodies = 1500"))
    assert main(["run", str(problem), "--seed", "1", "--workers", "1", "--out", str(run)]) == 0
    out = tmp_path / "tree.graphml"
    assert main(["export", str(run), "--to", "graphml", "--out", str(out)]) == 0
    graph = nx.read_graphml(out, node_type=int)
    assert nx.is_forest(graph)
    starts = [node for node, degree in graph.in_degree() if degree == 0]
    assert {graph.nodes[node]["rank"] for node in starts} == {0}
    for parent, node, edge in graph.edges(data=True):
        a, b = graph.nodes[parent], graph.nodes[node]
        assert b["rank"] == a["rank"] + 1
        assert edge["departure_mjd"] + edge["tof_days"] == pytest.approx(b["epoch_mjd"])
        assert edge["m_final_kg"] == pytest.approx(b["mass_kg"])
        assert edge["margin"] > 0.99
    assert all(at["name"] == f"S{at['body_id']:05}" for _, at in graph.nodes(data=True))
    best = [node for node, at in graph.nodes(data=True) if at["best"]]
    assert sorted(graph.nodes[node]["rank"] for node in best) == list(range(len(best)))

    csv_file = tmp_path / "tour.csv"
    assert main(["export", str(run), "--to", "csv", "--out", str(csv_file)]) == 0
    (run / "checkpoints").rename(run / "gone")
    capsys.readouterr()
    _fails(["export", run, "--to", "graphml", "--out", out], capsys, "checkpoints")
