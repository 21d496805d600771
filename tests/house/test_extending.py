"""The page on extension points: its examples run, and it leaves none out."""

import re
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "extending.md"
TEXT = PAGE.read_text(encoding="utf-8")
PARTS = (
    "Pruner",
    "Predictor",
    "Ranking",
    "Frontier",
    "Expander",
    "Problem",
    "Sampler",
    "Tour event",
    "Score rule",
    "Exporter",
)


def test_the_examples_run_in_their_order(tmp_path):
    blocks = re.findall(r"^```python\n(.*?)^```$", TEXT, re.M | re.S)
    assert len(blocks) == 1 + len(PARTS)
    script = tmp_path / "page.py"
    script.write_text("\n".join(blocks), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(script)],
        check=False,
        capture_output=True,
        text=True,
        timeout=300,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr


def test_each_part_has_a_section_with_an_example_and_a_row_of_the_table():
    sections = dict(re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", TEXT, re.M | re.S))
    assert tuple(sections) == PARTS
    for part, section in sections.items():
        assert "The contract" in section, part
        assert section.count("```python") == 1, part
        assert f"| [{part.lower()}](#" in TEXT


def test_the_examples_are_short():
    for block in re.findall(r"^```python\n(.*?)^```$", TEXT, re.M | re.S):
        assert len(block.splitlines()) <= 45
