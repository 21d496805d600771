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

    whole = tmp_path / "whole"
    whole_s = finished(run_line(whole)())
    kills = 0
    for k in range(3):
        folder = tmp_path / f"run{k}"
        kills += killed_often(run_line(folder), whole_s, 3, rng)
        names = ("sequence.json", "sequence.csv", "sequence.search.json")
        assert _bytes(folder, *names) == _bytes(whole, *names)
    polish_s = finished(polish_line(whole)())
    for k in range(2):
        folder = tmp_path / f"run{k}"
        kills += killed_often(polish_line(folder), polish_s, 3, rng)
        names = ("sequence.json", "sequence.search.json", "sequence.polished.json")
        assert _bytes(folder, *names) == _bytes(whole, *names)
    assert kills >= 8
