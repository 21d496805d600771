"""seqsearch resume, and runs that end badly: always one clear line, and a folder to go on from."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

from feasibility import AllOf, KeepAll, Mima2Pruner
from feasibility.pruners import PrunerContractError
from feasibility.runtime.workers import WorkersLostError
from seqsearch import search
from seqsearch.commands.cli import main
from tests.helpers.problem_texts import GOOD
from tests.helpers.problems import small_problem, small_settings

QUICK = GOOD.replace("synthetic_bodies = 300", "synthetic_bodies = 1500") + (
    '[search]\npruner = "mima2:0.97"\nbeam_width = 4\nstarts = 8\nstart_epochs = 2\n'
    "neighbours = 20\ntof_days_step = 40\nsolves_per_rank = 60\npasses = 2\n"
    "[search.audit]\nper_rank = 8\n"
)


@pytest.fixture(scope="module")
def problem_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("problem") / "quick.toml"
    path.write_text(QUICK)
    return path


@pytest.fixture(scope="module")
def whole(problem_file, tmp_path_factory):
    out = tmp_path_factory.mktemp("run") / "whole"
    assert (
        main(["run", str(problem_file), "--seed", "3", "--workers", "1", "--out", str(out)]) == 0
    )
    return out


@pytest.fixture(scope="module")
def scouted(tmp_path_factory):
    """A run of two passes that begin with scouting."""
    path = tmp_path_factory.mktemp("scouted")
    text = (
        QUICK.replace("mima2:0.97", "default:0.99")
        + "[search.scouts]\ngenerations = 1\nwidth = 6\n"
    )
    (path / "scouted.toml").write_text(text)
    out = path / "whole"
    arguments = ["run", str(path / "scouted.toml"), "--seed", "3", "--workers", "1"]
    assert main([*arguments, "--out", str(out)]) == 0
    return out


@pytest.fixture
def copied(whole, tmp_path):
    shutil.copytree(whole, tmp_path / "run")
    return tmp_path / "run"


def _counters(run):
    with (run / "counters.csv").open() as file:
        return [
            {key: value for key, value in row.items() if not key.startswith("seconds")}
            for row in csv.DictReader(file)
        ]


def _assert_same(run, whole):
    for name in ("sequence.json", "sequence.csv", "audit.json", "config.toml"):
        assert (run / name).read_bytes() == (whole / name).read_bytes()
    assert _counters(run) == _counters(whole)


def _resume(*arguments):
    return main(["resume", *(str(argument) for argument in arguments), "--workers", "1"])


def _fails(capsys, arguments, *words):
    assert _resume(*arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    for word in words:
        assert word in error


def test_killed_and_resumed_equals_undisturbed(problem_file, whole, tmp_path):
    out = tmp_path / "run"
    command = [sys.executable, "-m", "seqsearch", "run", str(problem_file), "--seed", "3"]
    with subprocess.Popen(
        [*command, "--workers", "1", "--out", str(out)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            for line in process.stdout:
                if "rank  2" in line:
                    break
        finally:
            os.killpg(process.pid, signal.SIGKILL)
    n_before = len(list((out / "checkpoints").iterdir()))
    assert n_before < len(list((whole / "checkpoints").iterdir()))
    assert _resume(out) == 0
    _assert_same(out, whole)
    assert len(json.loads((out / "provenance.json").read_text())["resumed"]) == 1


def test_from_an_earlier_rank_it_comes_to_the_same(copied, whole, capsys):
    assert _resume(copied, "--from-rank", "1:1") == 0
    assert "pass 1 rank  2" in capsys.readouterr().out
    _assert_same(copied, whole)


@pytest.mark.parametrize("rank", ["1:0", "1:1", "2:0", "0:0"])
def test_scouting_and_guided_passes_resume_to_the_same(scouted, tmp_path, rank):
    shutil.copytree(scouted, tmp_path / "run")
    assert [row["rank"] for row in _counters(scouted)].count("0") == 2
    assert _resume(tmp_path / "run", "--from-rank", rank) == 0
    _assert_same(tmp_path / "run", scouted)


def test_from_the_beginning(copied, whole):
    assert _resume(copied, "--from-rank", "0:0") == 0
    _assert_same(copied, whole)


def test_a_finished_run_says_its_result_again(copied, whole, capsys):
    assert _resume(copied) == 0
    out = capsys.readouterr().out
    assert "search complete" in out
    assert "rank  1" not in out
    _assert_same(copied, whole)


def test_a_run_stopped_by_a_limit_goes_on_with_a_larger_one(problem_file, whole, tmp_path, capsys):
    solves = sum(int(row["optimised"]) for row in _counters(whole))
    first = int(_counters(whole)[0]["optimised"])
    out = tmp_path / "run"
    arguments = ["run", str(problem_file), "--seed", "3", "--workers", "1", "--out", str(out)]
    assert main([*arguments, "--max-solves", str(first + 1)]) == 0
    assert f"seqsearch resume {out}" in capsys.readouterr().out
    _fails(capsys, [out, "--max-solves", first], "--max-solves", f"used {first} of {first}")
    assert _resume(out, "--max-solves", solves) == 0
    # The limit is that of the whole run, so both ended at the same solve.
    assert json.loads((out / "sequence.json").read_text()) == json.loads(
        (whole / "sequence.json").read_text()
    )


def test_a_used_up_time_limit_is_said(copied, capsys):
    _fails(capsys, [copied, "--time-limit", "0.001s"], "--time-limit", "has spent")


def test_what_is_no_run_folder_is_said(tmp_path, capsys):
    _fails(capsys, [tmp_path / "nowhere"], "nowhere")
    _fails(capsys, [tmp_path], "checkpoint")


def test_a_changed_configuration_is_said(copied, capsys):
    path = copied / "config.toml"
    path.write_text(path.read_text().replace("beam_width = 4", "beam_width = 5"))
    before = sorted(copied.rglob("*"))
    _fails(capsys, [copied, "--from-rank", "1:1"], "config.toml", "changed")
    assert sorted(copied.rglob("*")) == before


@pytest.mark.parametrize("text", ["2", "a:b", "1:2:3", "-1:2"])
def test_a_rank_that_cannot_be_read_is_said(copied, capsys, text):
    assert main(["resume", str(copied), f"--from-rank={text}"]) == 2
    assert "PASS:RANK" in capsys.readouterr().err


def test_a_changed_table_is_said(tmp_path, capsys):
    header = "Num\tEpoch\ta\te\ti\tw\tNode\tM\tName\n"
    rng = np.random.default_rng(0)
    rows = [
        f"{k}\t56800\t{2.5 + 0.02 * rng.random():.6f}\t0.05\t{rng.random():.4f}\t30\t60\t"
        f"{40 + 8 * rng.random():.4f}\tA{k}\n"
        for k in range(1, 61)
    ]
    table = tmp_path / "table.txt"
    table.write_text(header + "".join(rows))
    problem = tmp_path / "tabled.toml"
    problem.write_text(QUICK.replace("synthetic_bodies = 1500", 'file = "table.txt"'))
    out = tmp_path / "run"
    assert main(["run", str(problem), "--workers", "1", "--out", str(out)]) == 0
    assert _resume(out) == 0
    table.write_text(header + "".join(rows[:-1]))
    capsys.readouterr()
    _fails(capsys, [out], "table.txt", "not the asteroid table")


class Raises:
    def keep(self, legs, /):
        raise ValueError("no such\nthing")


class WrongShape:
    def keep(self, legs, /):
        return np.ones(3, dtype=bool)


class WrongType:
    def keep(self, legs, /):
        return legs.tof_days


class NoArray:
    def keep(self, legs, /):
        return True


class DropsAll:
    name = "drops-all"

    def keep(self, legs, /):
        return np.zeros(len(legs), dtype=bool)


class TurnsBad:
    """Good for the check before the search and for the first rank."""

    def __init__(self):
        self.calls = 0

    def keep(self, legs, /):
        self.calls += 1
        return Mima2Pruner().keep(legs) if self.calls < 8 else np.ones(1, dtype=np.float64)


BAD = [
    (Raises(), "Raises.keep: raised ValueError on", "no such thing"),
    (WrongShape(), "WrongShape.keep: returned shape (3,)", "expected ("),
    (WrongType(), "WrongType.keep: returned dtype float64", "expected bool"),
    (NoArray(), "NoArray.keep: returned bool", "expected a numpy array"),
]


@pytest.mark.parametrize(("pruner", "what", "expectation"), BAD)
@pytest.mark.parametrize("wrapped", [False, True])
def test_a_bad_pruner_is_named_by_search(pruner, what, expectation, wrapped):
    given = AllOf(KeepAll(), AllOf(pruner)) if wrapped else pruner
    with pytest.raises(PrunerContractError) as caught:
        search(small_problem(), pruner=given, settings=small_settings())
    message = str(caught.value)
    assert what in message
    assert expectation in message
    assert "\n" not in message


def _run_with(monkeypatch, pruner, problem_file, out):
    monkeypatch.setattr("seqsearch.runs.begin.parse_pruner", lambda spec: AllOf(pruner))
    arguments = ["run", str(problem_file), "--seed", "3", "--workers", "1", "--out", str(out)]
    return main(arguments)


def test_a_pruner_that_turns_bad_ends_with_code_2_and_a_saved_run(
    monkeypatch, problem_file, whole, tmp_path, capsys
):
    out = tmp_path / "run"
    assert _run_with(monkeypatch, TurnsBad(), problem_file, out) == 2
    error = capsys.readouterr().err
    assert "TurnsBad.keep: returned shape (1,)" in error
    assert f"seqsearch resume {out}" in error
    assert main(["verify", str(out)]) == 0
    # Going on with the pruner of the configuration, which is the same while it is good.
    assert _resume(out) == 0
    assert json.loads((out / "sequence.json").read_text()) == json.loads(
        (whole / "sequence.json").read_text()
    )


def test_a_pruner_that_drops_all_ends_with_a_word(monkeypatch, problem_file, tmp_path, capsys):
    out = tmp_path / "run"
    assert _run_with(monkeypatch, DropsAll(), problem_file, out) == 0
    assert "no leg survived pruner drops-all at rank 1" in capsys.readouterr().out
    # There is no leg that could be wrong, and none that could be right.
    assert main(["verify", str(out)]) == 1


def test_lost_workers_end_with_code_1_and_a_saved_run(
    monkeypatch, problem_file, whole, tmp_path, capsys
):
    out = tmp_path / "run"

    class Loses:
        def __init__(self):
            self.calls = 0

        def keep(self, legs, /):
            self.calls += 1
            if self.calls == 3:
                monkeypatch.setattr("seqsearch.core.optimisation.solve_hops", _lost)
            return Mima2Pruner(0.97).keep(legs)

    with monkeypatch.context():
        assert _run_with(monkeypatch, Loses(), problem_file, out) == 1
    monkeypatch.undo()
    assert f"died 3 times\nall ranks before are saved: go on with: seqsearch resume {out}" in (
        capsys.readouterr().err
    )
    assert _resume(out) == 0
    assert json.loads((out / "sequence.json").read_text()) == json.loads(
        (whole / "sequence.json").read_text()
    )


def _lost(hops, solver):
    raise WorkersLostError("worker processes died 3 times")


def test_the_best_tour_is_not_lost_by_going_on(copied, whole, monkeypatch):
    """A rank cut short may have found more than the checkpoint before it knows."""
    monkeypatch.setattr("seqsearch.budget.Budget.used_up", lambda self: True)
    assert _resume(copied, "--from-rank", "1:1") == 0
    assert (copied / "sequence.json").read_bytes() == (whole / "sequence.json").read_bytes()
