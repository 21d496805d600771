"""The guides to exports and reports: each command and each piece of Python that they show runs."""

import re
import shlex
from pathlib import Path

import pytest

from seqsearch.commands.cli import main
from tests.helpers.handmade_tours import handmade_run, handmade_tour

GUIDES = Path(__file__).resolve().parents[3] / "docs" / "guide"


@pytest.mark.parametrize("page", ["export.md", "report.md"])
def test_what_the_guide_shows_runs(page, tmp_path, monkeypatch):
    spice = pytest.importorskip("spiceypy", reason="spiceypy is not installed")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    handmade_run(tmp_path / "runs" / "demo")
    text = (GUIDES / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```(sh|python)\n(.*?)^```$", text, re.M | re.S)
    assert {kind for kind, _ in blocks} == {"sh", "python"}
    inside = handmade_tour().t_start_mjd2000 + 51544.0 + 50.0
    try:
        for kind, block in blocks:
            if kind == "python":
                exec(block.replace("61465.0", repr(inside)), {})
                continue
            for line in block.splitlines():
                program, *arguments = shlex.split(line)
                assert program == "seqsearch"
                assert main(arguments) == 0
    finally:
        spice.kclear()


def test_the_guide_lists_every_format_and_the_command_too(capsys):
    from seqsearch.tours.export import exporters

    text = (GUIDES / "export.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\| `(\w+)` \|", text, re.M))
    assert listed == {*exporters(), "graphml", "carrier"}
    with pytest.raises(SystemExit):
        main(["export", "--help"])
    shown = capsys.readouterr().out
    assert all(re.search(rf"^  {name} ", shown, re.M) for name in listed)
