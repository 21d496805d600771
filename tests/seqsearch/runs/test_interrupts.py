"""Limits, signals and pipes: a run that ends early leaves a result that goes on."""

import shutil
import signal
import subprocess
import sys
import time

import msgspec
import pytest

from seqsearch import read_tour
from seqsearch.commands.cli import main
from seqsearch.runs.run_folder import POLISHED, RunFolder, worth
from tests.helpers.problem_texts import QUICK
from tests.helpers.tables import write_table

PROBLEM = QUICK.replace("synthetic_bodies = 300", "synthetic_bodies = 1500") + "passes = 6\n"


def _command(*arguments):
    return [sys.executable, "-m", "seqsearch", *map(str, arguments)]


@pytest.fixture
def problem_file(tmp_path):
    path = tmp_path / "quick.toml"
    path.write_text(PROBLEM)
    return path


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The run that nothing disturbs."""
    path = tmp_path_factory.mktemp("whole")
    (path / "quick.toml").write_text(PROBLEM)
    assert main(["run", str(path / "quick.toml"), "--workers", "1", "--out", str(path / "r")]) == 0
    return path / "r"


def test_a_limit_before_the_first_node_is_an_empty_result_that_goes_on(
    problem_file, whole, tmp_path, capsys, monkeypatch
):
    out = tmp_path / "run"
    arguments = ["run", str(problem_file), "--workers", "1", "--out", str(out)]
    assert main([*arguments, "--time-limit", "0.000000001s"]) == 0
    printed = capsys.readouterr().out
    assert "nothing found yet" in printed
    assert "give more time" in printed
    tour = read_tour(out / "sequence.json")
    assert (tour.bodies, tour.legs, tour.score) == ((), (), 0.0)
    assert main(["verify", str(out)]) == 1
    assert "at least one leg" in capsys.readouterr().out
    assert main(["polish", str(out)]) == 2
    assert "nothing to polish" in capsys.readouterr().err
    assert main(["resume", str(out), "--max-solves", "20", "--time-limit", "1h"]) == 0
    assert len(read_tour(out / "sequence.json").legs) >= 1


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_even_twice_ends_tidily_and_the_run_goes_on(
    number, code, problem_file, whole, tmp_path
):
    out = tmp_path / "run"
    process = subprocess.Popen(
        _command("run", problem_file, "--workers", "2", "--out", out),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("pass 1 rank"):
            break
    process.send_signal(number)
    time.sleep(0.05)
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == code, errors
    assert "Traceback" not in errors
    assert len(read_tour(out / "sequence.json").legs) >= 1
    assert main(["resume", str(out), "--workers", "1"]) == 0
    assert (out / "sequence.json").read_bytes() == (whole / "sequence.json").read_bytes()


def test_a_closed_pipe_does_not_stop_the_work(problem_file, whole, tmp_path):
    out = tmp_path / "run"
    process = subprocess.Popen(
        _command("run", problem_file, "--workers", "1", "--out", out),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.stderr is not None
    errors = process.stderr.read()
    assert process.wait(timeout=120) == 0
    assert "Traceback" not in errors
    assert "Broken" not in errors
    assert (out / "sequence.json").read_bytes() == (whole / "sequence.json").read_bytes()


def test_a_polished_tour_is_not_replaced_by_going_on(whole, tmp_path):
    out = tmp_path / "run"
    shutil.copytree(whole, out)
    folder = RunFolder.open(out)
    searched = read_tour(out / "sequence.json")
    # The same visits, a day sooner, as polishing might have it.
    legs = list(searched.legs)
    legs[-1] = msgspec.structs.replace(legs[-1], tof_days=legs[-1].tof_days - 1.0)
    better = msgspec.structs.replace(searched, legs=tuple(legs))
    assert worth(better) > worth(searched)
    folder.write_polished(better)
    RunFolder.open(out).write(searched, [])
    assert read_tour(out / "sequence.json") == better
    assert read_tour(out / POLISHED) == better
    assert read_tour(out / "sequence.search.json") == searched


def test_a_run_folder_moves_with_its_table(tmp_path, capsys):
    home, away = tmp_path / "home", tmp_path / "away"
    home.mkdir()
    away.mkdir()
    write_table(home / "bodies.txt", 400)
    text = PROBLEM.replace("synthetic_bodies = 1500", 'file = "bodies.txt"')
    (home / "mine.toml").write_text(text)
    out = home / "run"
    limits = ["--workers", "1", "--max-solves", "30"]
    assert main(["run", str(home / "mine.toml"), "--out", str(out), *limits]) == 0
    for file in out.rglob("*.*"):
        if file.suffix in (".json", ".csv", ".toml"):
            assert str(tmp_path) not in file.read_text()
    (home / "bodies.txt").rename(away / "table.txt")
    out.rename(away / "moved")
    more = ["--workers", "1", "--max-solves", "60"]
    capsys.readouterr()
    assert main(["resume", str(away / "moved"), *more]) == 2
    assert "bodies.txt" in capsys.readouterr().err
    table = ["--catalogue", str(away / "table.txt")]
    assert main(["resume", str(away / "moved"), *table, *more]) == 0
    other = away / "other.txt"
    write_table(other, 401)
    assert main(["resume", str(away / "moved"), "--catalogue", str(other), *more[:3], "90"]) == 2
    assert "not the asteroid table" in capsys.readouterr().err
