import json

import pytest

from seqsearch.commands.cli import main
from seqsearch.problems import registry
from seqsearch.problems.registry import carrier_rules
from seqsearch.tours.carrier.carrier_files import CARRIER, write_carrier
from tests.helpers.carriers import (
    small_mission,
    small_rules,
    write_carrier_run,
    write_mission_table,
)


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "carrier_rules", lambda name: small_rules())
    (tmp_path / "run").mkdir()
    write_carrier_run(tmp_path / "run")
    write_mission_table(tmp_path / "table.txt")
    out = tmp_path / "out"
    assert main(["export", str(tmp_path / "run"), "--to", "carrier", "--out", str(out)]) == 0
    return out


def _verify(files, *options):
    table = str(files.parent / "table.txt")
    return main(["verify", str(files), "--problem", "small", "--catalogue", table, *options])


def test_a_run_is_exported_and_its_files_are_verified(files, capsys):
    assert sorted(file.name for file in files.iterdir()) == ["M.TXT", "P1.TXT", "P2.TXT"]
    capsys.readouterr()
    assert _verify(files, "--json") == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["verified"]
    assert answer["checks"][-1]["found"].startswith("2 asteroids, craft 3957.602 kg")


def test_a_broken_rule_is_exit_code_1(files, capsys):
    lines = (files / "M.TXT").read_text().splitlines()
    lines[3] = lines[3].replace("8.774848", "8.774948")
    (files / "M.TXT").write_text("\n".join(lines))
    assert _verify(files) == 1
    assert "NOT verified" in capsys.readouterr().out


def test_an_asteroid_that_is_not_in_the_table_is_named(files, capsys):
    table = files.parent / "table.txt"
    table.write_text(table.read_text().replace("\n101 ", "\n103 "))
    assert _verify(files) == 2
    assert "begins or ends at '101'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--catalogue", "{table}"], "say it with --problem NAME"),
        (["--problem", "small"], "say where it is with --catalogue FILE"),
    ],
)
def test_what_is_not_said_is_asked_for(files, capsys, options, says):
    options = [option.format(table=files.parent / "table.txt") for option in options]
    assert main(["verify", str(files), *options]) == 2
    assert says in capsys.readouterr().err


def test_craft_that_were_not_refined_are_not_exported(tmp_path, capsys):
    write_carrier_run(tmp_path)
    for name in ("trajectory.json", "trajectory.rows"):
        (tmp_path / "probe-2" / name).unlink()
    out = tmp_path / "out"
    assert main(["export", str(tmp_path), "--to", "carrier", "--out", str(out)]) == 2
    assert "probe-2: impulses, expected continuous thrust" in capsys.readouterr().err
    write_carrier(small_mission()[0], tmp_path / CARRIER)
    (tmp_path / CARRIER).write_text("{}")
    assert main(["export", str(tmp_path), "--to", "carrier", "--out", str(out)]) == 2


def test_the_rules_of_the_competition_are_found_by_name():
    rules = carrier_rules("gtoc7-full")
    assert rules.launch_mjd2000 == (59215.0 - 51544.0, 62867.0 - 51544.0)
    assert (rules.m0_kg, rules.m_dry_kg, rules.craft.max_duration_days) == (24e3, 6e3, 2191.5)
    assert rules.planet.a_m == pytest.approx(1.496e11, rel=1e-3)
    with pytest.raises(ValueError, match="problem demo: not one that a carrier flies"):
        carrier_rules("demo")
