"""A carrier's run that is killed at any moment goes on to the result of an undisturbed one."""

import shutil
import sys

import numpy as np
import pytest

from seqsearch.commands.cli import main
from seqsearch.runs.carrier_run import STATE
from tests.helpers.carriers import BELT_PROBLEM
from tests.helpers.killing import finished, killed_often

CODE = """
import sys
from pathlib import Path
from feasibility.errors import InputError
from seqsearch.budget import Limits
from seqsearch.problems.problem_file import read_config
from seqsearch.runs.carrier_run import begin_carrier, resume_carrier
from tests.helpers.carriers import TINY_CAMPAIGN

how, problem, folder = sys.argv[1:]
try:
    if how == "begin":
        config = read_config(problem)
        sys.exit(begin_carrier(config, Path(folder), 3, Limits(workers=1), TINY_CAMPAIGN))
    sys.exit(resume_carrier(Path(folder), Limits(workers=1), None, TINY_CAMPAIGN))
except InputError as error:
    print(error, file=sys.stderr)
    sys.exit(2)
"""


@pytest.mark.slow
def test_a_run_that_is_killed_ends_alike(tmp_path, capsys):
    problem = tmp_path / "belt.toml"
    problem.write_text(BELT_PROBLEM)

    def line(folder):
        how = "resume" if (folder / STATE).is_file() else "begin"
        if how == "begin":
            # Killed before the folder was complete: a user would begin again.
            shutil.rmtree(folder, ignore_errors=True)
        return [sys.executable, "-c", CODE, how, str(problem), str(folder)]

    whole, broken = tmp_path / "whole", tmp_path / "broken"
    # Kernels compiled in this process may differ in the last bits from those of the cache.
    finished(line(tmp_path / "first"))
    seconds = finished(line(whole))
    rng = np.random.default_rng(1)
    # A kill after the chart leaves less than half of the time to be killed in again.
    kills = killed_often(lambda: line(broken), 0.8 * seconds, 5, rng)
    assert kills >= 3
    # All but fleet.json, which says how and when it was made.
    names = ["carrier.json"]
    names += [
        f"probe-{k}/{name}"
        for k in (1, 2, 3)
        for name in ("config.toml", "sequence.json", "sequence.csv")
    ]
    for name in names:
        assert (broken / name).read_bytes() == (whole / name).read_bytes(), name
    assert main(["verify", str(broken)]) == 0
    assert not list(broken.rglob("*.tmp"))
    capsys.readouterr()
