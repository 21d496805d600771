import subprocess
import sys

import msgspec
import numpy as np
import pytest

from feasibility import InputError
from seqsearch.tours.carrier.reading import is_carrier, read_carrier_files
from seqsearch.tours.carrier.rows import write_carrier_rows
from seqsearch.tours.carrier.verify import verify_carrier
from tests.helpers.carriers import small_mission


@pytest.fixture
def folder(tmp_path):
    carrier, craft, _ = small_mission()
    write_carrier_rows(tmp_path, carrier, craft)
    return tmp_path


def _failed(folder, craft=None, **rules):
    carrier, _, bodies = small_mission()
    changed = msgspec.structs.replace(carrier.rules.craft, **(craft or {}))
    changed = msgspec.structs.replace(carrier.rules, craft=changed, **rules)
    outcome = verify_carrier(read_carrier_files(folder), bodies, changed)
    return [check.name for check in outcome.checks if not check.passed]


def _edit(file, change):
    """Change a file's lines, given as lists of cells for rows and as texts for comments."""
    rows = [
        line if line.startswith("#") else line.split() for line in file.read_text().splitlines()
    ]
    rows = change(rows) or rows
    file.write_text("\n".join(row if isinstance(row, str) else " ".join(row) for row in rows))


def _add(select, column, value):
    """Return a change that adds to a column of the rows that `select` picks."""

    def change(rows):
        plain = [row for row in rows if not isinstance(row, str)]
        for row in select(plain):
            row[column] = repr(float(row[column]) + value)

    return change


def _event(*names):
    return lambda rows: [row for row in rows if " ".join(row[8:]) in names]


def _every(rows):
    return rows


def _rows(*numbers):
    return lambda rows: [rows[number] for number in numbers]


def test_a_flight_that_keeps_all_rules_passes(folder):
    assert is_carrier(folder)
    assert _failed(folder) == []


def test_the_score_counts_asteroids_and_the_craft_that_came_back(folder):
    carrier, craft, bodies = small_mission()
    outcome = verify_carrier(read_carrier_files(folder), bodies, carrier.rules)
    together = sum(float(rows.phases[-1].mass_kg[-1]) for rows in craft.values())
    assert outcome.checks[-1].found == f"2 asteroids, craft {together:.3f} kg together"


def test_a_craft_that_nobody_catches_counts_nothing(folder):
    carrier, _, bodies = small_mission()
    _edit(folder / "M.TXT", lambda rows: rows[:-1])
    files = read_carrier_files(folder)
    outcome = verify_carrier(files, bodies, carrier.rules)
    assert outcome.checks[-1].found.startswith("1 asteroids, craft 1976.599 kg")
    assert not outcome.passed


@pytest.mark.parametrize(
    ("change", "failed"),
    [
        (_add(_event("LAUNCH"), 1, 1500.0), "position at launch"),
        (_add(_event("LAUNCH"), 5, 0.01), "speed at launch"),
        (_add(_event("LAUNCH"), 7, 1.0), "mass at launch"),
        (_add(_event("LAUNCH"), 7, -1.0), "carrier: rocket equation"),
        (_add(_event("DV"), 4, 0.01), "carrier: rocket equation"),
        (_add(_event("DV"), 7, 0.5), "carrier: rocket equation"),
        (_add(_event("DV"), 1, 5.0), "carrier: coasts, position"),
        (_add(_event("RELEASE P1"), 4, 1e-5), "carrier: coasts, velocity"),
        (_add(_event("RELEASE P1"), 7, 1.0), "carrier: mass lost at releases"),
        (_add(_event("CAPTURE P2"), 7, 1.0), "carrier: mass gained at captures"),
        (_add(_event("CAPTURE P2"), 4, 0.1), "P2: velocity at capture"),
        (_add(_event("CAPTURE P2"), 1, 2000.0), "P2: position at capture"),
        (_add(_event("RELEASE P1"), 1, 2000.0), "P1: position at release"),
        (_add(_event("RELEASE P1"), 4, 0.1), "P1: velocity at release"),
        (_add(_event("RELEASE P1"), 0, -0.01), "P1: rows from release to capture"),
        (_add(_event("CAPTURE P2"), 0, 0.01), "P2: rows from release to capture"),
        (_add(_every, 0, 30.0), "launch in the window"),
        (lambda rows: rows[:2] + rows[3:], "order of events"),
        (lambda rows: [*rows, rows[2]], None),
        (lambda rows: [row for row in rows if "P2" not in row], "order of events"),
        (lambda rows: [*rows, [*rows[-1][:8], "CAPTURE", "P1"]], "order of events"),
    ],
)
def test_each_rule_of_the_carrier_broken_is_caught(folder, change, failed):
    _edit(folder / "M.TXT", change)
    if failed is None:
        with pytest.raises(InputError, match="expected time to go on"):
            _failed(folder)
    else:
        assert failed in _failed(folder)


@pytest.mark.parametrize(
    ("change", "failed"),
    [
        (_add(_rows(7), 1, 2.0), "P1: motion from each row to the next"),
        (_add(_rows(7), 5, 1e-5), "P1: motion from each row to the next"),
        (_add(_rows(0), 1, 2000.0), "P1: position at release"),
        (_add(_rows(0), 5, 0.002), "P1: velocity at release"),
        (_add(_rows(50), 1, 2000.0), "P1: position at bodies"),
        (_add(_rows(51), 6, 0.002), "P1: velocity at bodies"),
        (_add(_rows(-1), 1, 2000.0), "P1: position at capture"),
        (_add(_rows(-1), 6, 0.002), "P1: velocity at capture"),
        (_add(_rows(3), 9, 0.3), "P1: thrust"),
        (_add(_rows(3), 9, 0.1), "P1: mass flow is thrust over exhaust velocity"),
        (_add(_every, 7, 5.0), "P1: mass at release"),
        (_add(_rows(*range(51, 141)), 7, 1.0), "P1: mass during stays"),
        (_add(_every, 7, -120.0), "P1: final mass"),
        (_add(_rows(*range(51, 141)), 0, -2.0), "P1: stays"),
        (_add(_every, 0, -1.0), "P1: rows from release to capture"),
        (lambda rows: [row for k, row in enumerate(rows) if k != 9], "P1: step from each row"),
        (lambda rows: [row.replace("101 -> MOTHER", "102 -> MOTHER") if isinstance(row, str)
                       else row for row in rows], "P1: phases join"),
        (lambda rows: [row.replace("101", "102") if isinstance(row, str) else row
                       for row in rows], "no body twice"),
    ],
)  # fmt: skip
def test_each_rule_of_a_craft_broken_is_caught(folder, change, failed):
    _edit(folder / "P1.TXT", change)
    assert any(name.startswith(failed) for name in _failed(folder))


@pytest.mark.parametrize(
    ("rules", "failed"),
    [
        ({"max_impulses": 2}, "impulses"),
        ({"max_duration_days": 209.0}, "duration, launch to last capture"),
        ({"m0_kg": 9001.0}, "mass at launch"),
        ({"m_dry_kg": 4800.0}, "carrier: final mass without craft"),
        ({"v_inf_max_m_s": 499.0}, "speed at launch"),
        ({"launch_mjd2000": (8001.0, 8010.0)}, "launch in the window"),
        ({"craft": {"max_duration_days": 175.0}}, "P2: duration, release to capture"),
        ({"craft": {"m_dry_kg": 1980.0}}, "P1: final mass"),
    ],
)
def test_each_limit_is_checked(folder, rules, failed):
    assert _failed(folder, **rules) == [failed]


@pytest.mark.parametrize(
    ("name", "line", "text", "says"),
    [
        ("M.TXT", 3, "nan 1 1 1 1 1 1 1 DV", r"M\.TXT, line 4: nan, expected a number"),
        ("M.TXT", 3, "1 2 3", r"M\.TXT, line 4: 3 columns, expected MJD"),
        ("M.TXT", 3, "59554.25 1 1 x 1 1 1 1 DV", r"line 4: 'x', expected a number"),
        ("M.TXT", 3, "59554.25 1 1 1 1 1 1 1 BURN", r"line 4: event 'BURN', expected LAUNCH"),
        ("M.TXT", 3, "59554.25 1 1 1 1 1 1 1 RELEASE P0", "event 'RELEASE P0'"),
        ("M.TXT", 3, "59554.25 1 1 1 1 1 1 -1 DV", "mass -1 kg"),
        ("M.TXT", 3, "59554.25 0 0 0 1 1 1 1 DV", "a position in the Sun"),
        ("M.TXT", 3, "59000 1 1 1 1 1 1 1 DV", "expected time to go on"),
        ("P1.TXT", 4, "59564 inf 1 1 1 1 1 1 0 0 0", r"P1\.TXT, line 5: inf, expected a number"),
        ("P1.TXT", 4, "59564 1 1", "3 columns"),
        ("P1.TXT", 2, "# phase 2: MOTHER -> 101", "expected 'phase 1: FROM -> TO'"),
        ("P1.TXT", 2, "# phase 1: MOTHER -> 777", "begins or ends at '777'"),
        ("P1.TXT", 2, "# phase 1: MOTHER -> MOTHER", "begins or ends at 'MOTHER'"),
        ("P1.TXT", 2, "", "a row before the first line"),
    ],
)
def test_damaged_files_are_one_clear_line(folder, name, line, text, says):
    lines = (folder / name).read_text().splitlines()
    lines[line] = text
    (folder / name).write_text("\n".join(lines))
    with pytest.raises(InputError, match=says) as caught:
        _failed(folder)
    assert "\n" not in str(caught.value)


def test_files_that_are_missing_or_empty_are_named(folder):
    (folder / "P2.TXT").unlink()
    with pytest.raises(InputError, match=r"P2\.TXT: cannot be read"):
        read_carrier_files(folder)
    (folder / "P2.TXT").write_text("# nothing\n")
    with pytest.raises(InputError, match=r"P2\.TXT: no line '# phase 1"):
        read_carrier_files(folder)
    (folder / "M.TXT").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match=r"M\.TXT: not a text file"):
        read_carrier_files(folder)


def test_thrust_in_the_last_row_of_a_phase_is_refused(folder):
    _edit(folder / "P1.TXT", _add(_rows(-1), 8, 0.1))
    with pytest.raises(InputError, match="thrust in the last row"):
        _failed(folder)


def test_a_craft_may_be_released_at_rest_at_an_asteroid(folder):
    """Drop the first phase: the carrier is not at the asteroid, so only that is wrong."""
    carrier, craft, bodies = small_mission()
    lines = (folder / "P1.TXT").read_text().splitlines()
    second = next(k for k, line in enumerate(lines) if line.startswith("# phase 2"))
    (folder / "P1.TXT").write_text("\n".join(["# phase 1: 101 -> MOTHER", *lines[second + 1 :]]))
    outcome = verify_carrier(read_carrier_files(folder), bodies, carrier.rules)
    failed = {check.name for check in outcome.checks if not check.passed}
    assert failed == {"P1: position at bodies", "P1: velocity at bodies", "P1: mass at release"}
    assert outcome.checks[-1].found.startswith("2 asteroids")
    assert np.isfinite(float(craft[1].phases[0].mass_kg[0]))


def test_the_verifier_loads_nothing_of_solvers_kernels_problems_and_the_writer():
    code = (
        "import seqsearch.tours.carrier.verify, sys; print([m for m in sys.modules if "
        "'sims_flanagan' in m or 'problems' in m or '_kernels' in m or 'continuous' in m "
        "or 'export' in m or 'carrier.path' in m or 'carrier.rows' in m or 'orbits' in m])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "[]\n"
