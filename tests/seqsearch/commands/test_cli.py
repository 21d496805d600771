"""The command line: exit codes, files, and bad input that leaves nothing behind."""

import csv
import json
import os
import signal
import subprocess
import sys
import tomllib

import pytest

from seqsearch.commands.cli import main
from seqsearch.commands.options import parse_duration
from seqsearch.problems.registry import builtin_problems
from tests.helpers.problem_texts import QUICK


@pytest.fixture
def problem_file(tmp_path):
    path = tmp_path / "quick.toml"
    path.write_text(QUICK.replace("synthetic_bodies = 300", "synthetic_bodies = 1500"))
    return path


@pytest.fixture
def run_folder(problem_file, tmp_path, capsys):
    out = tmp_path / "run"
    options = ["--seed", "1", "--workers", "1", "--out", str(out)]
    assert main(["run", str(problem_file), *options]) == 0
    capsys.readouterr()
    return out


def _fails(arguments, capsys, *words):
    assert main([str(argument) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    for word in words:
        assert word in captured.err


def test_a_run_writes_its_folder_and_verifies(run_folder, capsys):
    names = {path.name for path in run_folder.iterdir()}
    assert names == {
        "config.toml", "provenance.json", "counters.csv", "sequence.json", "sequence.csv",
        "tour.png", "audit.json", "candidates.csv", "checkpoints", "sequence.search.json", ".lock",
    }  # fmt: skip
    assert tomllib.loads((run_folder / "config.toml").read_text())["search"]["beam_width"] == 3
    provenance = json.loads((run_folder / "provenance.json").read_text())
    assert provenance["seed"] == 1
    assert provenance["versions"]["pykep"]
    counters = list(csv.DictReader((run_folder / "counters.csv").open()))
    assert int(counters[0]["proposed"]) > int(counters[0]["optimised"]) > 0
    assert main(["verify", str(run_folder)]) == 0
    assert "verified" in capsys.readouterr().out


def test_plot_draws_the_tour(run_folder, tmp_path, capsys):
    picture = tmp_path / "tour.svg"
    assert main(["plot", str(run_folder), "--out", str(picture)]) == 0
    assert "<svg" in picture.read_text()
    _fails(["plot", run_folder, "--out", tmp_path / "tour.xyz"], capsys, ".svg")


def test_a_tampered_sequence_fails_with_exit_code_1(run_folder, capsys):
    path = run_folder / "sequence.json"
    document = json.loads(path.read_text())
    document["legs"][0]["impulses"][0]["dv_m_s"][0] += 50.0
    path.write_text(json.dumps(document))
    assert main(["verify", str(path)]) == 1
    assert "NOT verified" in capsys.readouterr().out


def test_an_existing_run_folder_is_left_alone(run_folder, problem_file, capsys):
    def contents():
        return {path: path.read_bytes() for path in run_folder.rglob("*") if path.is_file()}

    before = contents()
    _fails(["run", problem_file, "--out", run_folder], capsys, str(run_folder), "exists")
    assert contents() == before


def test_an_output_that_cannot_be_written_is_said(problem_file, tmp_path, capsys):
    blocker = tmp_path / "file"
    blocker.write_text("")
    _fails(["run", problem_file, "--out", blocker / "run"], capsys, "cannot be created")


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("Num\tEpoch\ta\te\ti\tw\tNode\tM\tName\n1 56800 2.3 0.1 7 151 103\n", ["line 2"]),
        ("Num\tEpoch\ta\te\ti\tw\tNode\tM\tName\n1 56800 nan 0.1 7 151 103 326 Vesta\n", ["line"]),
        ("", []),
        ("nothing like a table\n", []),
    ],
)
def test_a_malformed_table_leaves_no_run_folder(problem_file, tmp_path, capsys, table, words):
    path = tmp_path / "table.txt"
    path.write_text(table)
    out = tmp_path / "out"
    arguments = ["run", problem_file, "--catalogue", path, "--out", out]
    _fails(arguments, capsys, str(path), *words)
    assert not out.exists()


@pytest.mark.parametrize(
    ("extra", "word"),
    [
        (["--time-limit", "soon"], "soon"),
        (["--workers", "0"], "--workers"),
        (["--seed", "-1"], "--seed"),
        (["--beam-width", "0"], "beam_width"),
        (["--pruner", "magic"], "magic"),
        (["--catalogue", "none.txt"], "none.txt"),
    ],
)
def test_bad_options_leave_no_run_folder(problem_file, tmp_path, capsys, extra, word):
    out = tmp_path / "out"
    _fails(["run", problem_file, "--out", out, *extra], capsys, word)
    assert not out.exists()


def test_gtoc7_without_a_table_says_what_to_do(capsys, tmp_path):
    _fails(["run", "gtoc7", "--out", tmp_path / "x"], capsys, "--catalogue")


@pytest.mark.parametrize("content", [None, "", '{"format": "seqsearch-tour-1"', "[]", "{}"])
def test_verify_refuses_what_is_no_tour(tmp_path, capsys, content):
    path = tmp_path / "sequence.json"
    if content is not None:
        path.write_text(content)
    _fails(["verify", tmp_path], capsys, str(path))


def test_a_tour_of_another_version_is_refused(run_folder, capsys):
    path = run_folder / "sequence.json"
    path.write_text(path.read_text().replace("seqsearch-tour-2", "seqsearch-tour-9"))
    _fails(["verify", run_folder], capsys, "seqsearch-tour-9")


def test_problems_prints_files_to_start_from(capsys):
    assert main(["problems"]) == 0
    listed = capsys.readouterr().out
    for name, text in builtin_problems().items():
        assert name in listed
        assert main(["problems", name]) == 0
        assert capsys.readouterr().out == text


@pytest.mark.parametrize(
    ("text", "seconds"), [("90s", 90), ("10min", 600), ("1.5h", 5400), ("600", 600)]
)
def test_durations(text, seconds):
    assert parse_duration(text) == seconds


def test_ctrl_c_ends_with_a_tour_and_exit_code_130(tmp_path, problem_file):
    out = tmp_path / "run"
    text = problem_file.read_text().replace("starts = 6", "starts = 6\npasses = 10000")
    problem_file.write_text(text)
    command = [sys.executable, "-m", "seqsearch", "run", str(problem_file), "--out", str(out)]
    process = subprocess.Popen(
        [*command, "--workers", "2"], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    for line in process.stdout:
        if "rank  1" in line:
            break
    os.killpg(process.pid, signal.SIGINT)
    rest = process.stdout.read()
    assert process.wait(timeout=60) == 130
    assert "search interrupted" in rest
    assert main(["verify", str(out)]) == 0
