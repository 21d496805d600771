"""A run on a Dask cluster: the same tour, even where a worker is killed midway."""

import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from feasibility.runtime import cluster
from seqsearch.commands.cli import main
from tests.helpers.clusters import running_cluster
from tests.helpers.problem_texts import QUICK

pytest.importorskip("distributed")

PROBLEM = (
    QUICK.replace("synthetic_bodies = 300", "synthetic_bodies = 1500").replace(
        'pruner = "lambert:1.3,mima2:0.97"', 'pruner = "default:0.99"'
    )
    + "passes = 2\n[search.scouts]\ngenerations = 1\nwidth = 10\n"
)


@pytest.fixture(scope="module")
def problem_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("problem") / "quick.toml"
    path.write_text(PROBLEM)
    return path


@pytest.fixture(scope="module")
def alone(problem_file):
    """The run in this process."""
    out = problem_file.parent / "alone"
    assert main(["run", str(problem_file), "--workers", "1", "--out", str(out)]) == 0
    return out


def _wait_for_rank(out: Path, work: Future[int]) -> None:
    while not _ranks(out):
        assert not work.done(), work.result()
        time.sleep(0.02)


def _ranks(out: Path) -> int:
    counters = out / "counters.csv"
    return max(0, len(counters.read_text().splitlines()) - 1) if counters.exists() else 0


def test_with_a_worker_killed_midway_the_tour_is_that_of_a_run_alone(
    problem_file, alone, tmp_path, capsys
):
    out = tmp_path / "run"
    with running_cluster(tmp_path, 2) as there, ThreadPoolExecutor(1) as background:
        arguments = ["run", str(problem_file), "--scheduler", there.address, "--out", str(out)]
        work = background.submit(main, arguments)
        _wait_for_rank(out, work)
        there.kill_worker(0)
        assert not work.done()
        assert work.result(timeout=300) == 0
    assert (out / "sequence.json").read_bytes() == (alone / "sequence.json").read_bytes()
    assert "workers were lost 1 times" in capsys.readouterr().out


@pytest.mark.slow
def test_with_all_workers_killed_a_run_ends_in_a_line_and_goes_on(
    problem_file, alone, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(cluster, "_PATIENCE_S", 1.0)
    out = tmp_path / "run"
    with running_cluster(tmp_path, 1) as there, ThreadPoolExecutor(1) as background:
        arguments = ["run", str(problem_file), "--scheduler", there.address, "--out", str(out)]
        work = background.submit(main, arguments)
        _wait_for_rank(out, work)
        there.kill_worker(0)
        assert work.result(timeout=60) == 1
        errors = capsys.readouterr().err.splitlines()
        assert errors[0].startswith("seqsearch: all workers of the Dask scheduler tcp://")
        assert errors[1].endswith(f"go on with: seqsearch resume {out}")
        there.add_worker()
        there.wait_for(1)
        assert main(["resume", str(out), "--scheduler", there.address]) == 0
    assert (out / "sequence.json").read_bytes() == (alone / "sequence.json").read_bytes()


@pytest.mark.filterwarnings("ignore")
def test_without_a_scheduler_there_is_one_line_and_no_folder(
    problem_file, alone, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.5)
    out = tmp_path / "run"
    nowhere = ["--scheduler", "tcp://127.0.0.1:1"]
    before = {path: path.read_bytes() for path in alone.rglob("*") if path.is_file()}
    for command in (
        ["run", str(problem_file), "--out", str(out)],
        ["resume", str(alone)],
        ["polish", str(alone)],
    ):
        capsys.readouterr()
        assert main([*command, *nowhere]) == 2
        error = capsys.readouterr().err
        assert error.startswith("seqsearch: --scheduler tcp://127.0.0.1:1: no Dask scheduler")
        assert error.count("\n") == 1
    assert not out.exists()
    assert before == {path: path.read_bytes() for path in alone.rglob("*") if path.is_file()}
