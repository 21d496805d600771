"""The examples run, stay short, and print what they promise."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.mark.parametrize(
    ("script", "arguments", "promise"),
    [
        ("search_demo.py", ["--bodies", "1500", "--days", "500", "--beam-width", "5"], "verified"),
        ("custom_pruner.py", ["--bodies", "1500", "--days", "400"], "keeps the contract"),
        ("custom_search.py", ["--legs", "2"], "flyable\n  S"),
        ("monte_carlo_tree_search.py", ["15"], "planned legs flown"),
        ("scikit_learn_pruner.py", ["--legs", "1200"], "verified"),
    ],
)
def test_example(script, arguments, promise):
    command = [sys.executable, str(EXAMPLES / script), *arguments]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert promise in done.stdout
    assert "NOT" not in done.stdout


def test_examples_are_short():
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text().splitlines()) < 100, path.name
