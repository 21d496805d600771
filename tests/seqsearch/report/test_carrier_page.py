"""The page of a carrier: from its files or its run, and without any script."""

import re

import pytest

from feasibility.errors import InputError
from seqsearch.commands.cli import main
from seqsearch.report.carrier_page import render, write_carrier_report
from seqsearch.runs.carriers import carrier_flight
from seqsearch.tours.carrier.rows import write_carrier_rows
from tests.helpers.carriers import small_mission, write_carrier_run


@pytest.fixture
def files(tmp_path):
    carrier, craft, _ = small_mission()
    folder = tmp_path / "files"
    folder.mkdir()
    write_carrier_rows(folder, carrier, craft)
    return folder


def test_the_page_says_events_legs_and_what_counts(files, tmp_path):
    size = write_carrier_report(files, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert size == len(page.encode())
    assert "2 asteroids by 2 craft, 2 of which came back with 3957.602 kg together" in page
    assert "3 impulses, 236.6 m/s" in page
    for words in ("RELEASE P1", "CAPTURE P2", "MOTHER -&gt; 101 -&gt; MOTHER", "223.61", "31.00"):
        assert words in page
    assert "<script" not in page
    assert "script-src" not in page
    assert "nan" not in page.lower()
    assert not re.search(r'(href|src|style)="', page)


def test_a_run_gives_the_same_page_as_its_files(files, tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    write_carrier_run(run)
    assert render(carrier_flight(run)) == render(carrier_flight(files))
    assert main(["report", str(run)]) == 0
    assert (run / "report.html").read_text() == render(carrier_flight(files))


def test_names_from_files_are_shown_and_never_obeyed(files, tmp_path):
    evil = "<img/src=x>"
    file = files / "P1.TXT"
    file.write_text(
        file.read_text().replace(" 101\n", f" {evil}\n").replace(": 101 ", f": {evil} ")
    )
    page = render(carrier_flight(files))
    assert evil not in page
    assert "&lt;img/src=x&gt;" in page


def test_damaged_files_are_named(files, tmp_path):
    (files / "M.TXT").write_text("59544 1 1\n")
    with pytest.raises(InputError, match=r"M\.TXT, line 1: 3 columns"):
        write_carrier_report(files, tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()
