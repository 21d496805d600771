"""Runs and polishing that are killed at any moment go on to the result of an undisturbed one."""

import shutil

import numpy as np
import pytest

from tests.helpers.killing import command, finished, killed_often
from tests.helpers.problem_texts import QUICK

PROBLEM = QUICK.replace("synthetic_bodies = 300", "synthetic_bodies = 1500") + "passes = 6\n"


def _bytes(folder, *names):
    return [(folder / name).read_bytes() for name in names]


@pytest.mark.slow
def test_a_run_that_is_killed_and_its_polishing_end_alike(tmp_path):
    (tmp_path / "quick.toml").write_text(PROBLEM)
    rng = np.random.default_rng(1)

    def run_line(folder):
        def line():
            if not (folder / "checkpoints").exists():
                # Killed before the folder was complete: a user would begin again.
                shutil.rmtree(folder, ignore_errors=True)
                return command(
                    "seqsearch", "run", tmp_path / "quick.toml", "--seed", 3, "--out", folder
                )
            return command("seqsearch", "resume", folder)

        return line

    def polish_line(folder):
        return lambda: command("seqsearch", "polish", folder)

    def alike(folder, line, seconds, *names):
        kills, k = 0, 0
        while kills < 6 and k < 24:
            kills += killed_often(line(folder(k)), seconds, 3, rng)
            assert _bytes(folder(k), *names) == _bytes(whole, *names)
            k += 1
        return kills

    whole = tmp_path / "whole"
    # Kernels compiled in this process may differ in the last bits from those of the cache.
    finished(run_line(tmp_path / "first")())
    run_s = finished(run_line(whole)())
    names = ("sequence.json", "sequence.csv", "sequence.search.json")
    assert alike(lambda k: tmp_path / f"run{k}", run_line, run_s, *names) >= 6

    def copied(k):
        folder = tmp_path / f"polish{k}"
        if not folder.exists():
            shutil.copytree(tmp_path / "first", folder)
        return folder

    polish_s = finished(polish_line(whole)())
    names = ("sequence.json", "sequence.search.json", "sequence.polished.json")
    assert alike(copied, polish_line, polish_s, *names) >= 6
