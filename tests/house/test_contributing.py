"""The worked example of CONTRIBUTING.md: what a reader pastes works."""

import os
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"^`(\S+)`\n\n```\w+\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL))
"""Paths and contents of the files that the page shows."""

PLUGIN = """
import seqsearch.problems

seqsearch.problems.__path__.append({folder!r})
"""
"""A plug-in of pytest: the example's folder lies elsewhere and counts as one of the package."""


def _block(language: str, beginning: str) -> str:
    """Return the block of the page that begins so."""
    found = re.search(rf"^```{language}\n({re.escape(beginning)}.*?)^```$", PAGE, re.M | re.S)
    assert found is not None
    return found[1]


@pytest.fixture
def pasted(tmp_path):
    """Return a folder with the example's files, and its entry point as if it were installed."""
    for name, content in FILES.items():
        path = tmp_path / "pasted" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
    table = tomllib.loads(_block("toml", "[project.entry-points"))
    ((group, lines),) = table["project"]["entry-points"].items()
    # Where somebody has pasted the example into the checkout it is installed already.
    there = {entry.name for entry in metadata.entry_points(group=group)}
    points = "".join(f"{name} = {at}\n" for name, at in lines.items() if name not in there)
    installed = tmp_path / "example-1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: example\nVersion: 1.0\n")
    (installed / "entry_points.txt").write_text(f"[{group}]\n{points}")
    folder = str(tmp_path / "pasted" / "seqsearch" / "problems")
    (tmp_path / "join_example.py").write_text(PLUGIN.format(folder=folder))
    return tmp_path


def _run(folder: Path, *arguments: str, stdin: str = "") -> str:
    done = subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"},
        check=False,
        capture_output=True,
        text=True,
        input=stdin,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_page_shows_a_whole_plug_in():
    assert sorted(Path(name).name for name in FILES) == [
        "__init__.py",
        "bands.toml",
        "problem.py",
        "rules.py",
        "test_bands.py",
    ]


def test_the_example_passes_its_own_tests(pasted):
    (test,) = pasted.glob("pasted/tests/**/test_*.py")
    options = ["-q", "-p", "join_example", "-p", "no:cacheprovider", "-c", os.devnull]
    said = _run(pasted, "pytest", *options, "--rootdir", str(pasted), str(test))
    assert "3 passed" in said


@pytest.mark.parametrize("name", [name for name in FILES if name.endswith(".py")])
def test_the_example_passes_the_linter_where_it_is_pasted(name):
    # Where the files are not there, ruff would take their imports for a third party's.
    ours = ["--config", 'lint.isort.known-first-party = ["feasibility", "seqsearch"]']
    for command in (["check", *ours], ["format", "--check"]):
        _run(ROOT, "ruff", *command, "--stdin-filename", name, "-", stdin=FILES[name])


def test_the_paragraph_for_the_guide_names_every_key():
    documented = re.findall(r"^\| `(\w+)` \|", _block("md", "`[bands]`"), re.M)
    rules = FILES["seqsearch/problems/bands/rules.py"]
    assert documented == re.findall(r"^    (\w+): ", rules, re.M)
