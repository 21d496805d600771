"""Problem files and settings: what is accepted, and how mistakes are named."""

import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from feasibility import InputError, Spacecraft
from seqsearch.problems.extra_bodies import BodyTable
from seqsearch.problems.problem_file import (
    CatalogueTable,
    Config,
    FleetTable,
    MissionTable,
    ProblemTable,
    SpacecraftTable,
    build_problem,
    builtin_problems,
    load_problem,
    override,
    read_config,
    to_toml,
    with_catalogue,
    with_selection,
)
from seqsearch.problems.registry import plugins
from seqsearch.pruning.pruner_spec import parse_pruner
from seqsearch.settings import (
    AuditSettings,
    FrontierSettings,
    ScoutSettings,
    SearchSettings,
)
from tests.helpers.problem_texts import GOOD
from tests.helpers.problems import GTOC7_TABLE, small_problem


def _write(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return str(path)


def test_a_problem_file_becomes_a_problem(tmp_path):
    problem = build_problem(read_config(_write(tmp_path, GOOD)))
    assert problem.m0 == 2000.0
    assert problem.first_departure_mjd2000 == (59215 - 51544, 60000 - 51544)
    assert len(problem.catalogue) == 300


@pytest.mark.parametrize("name", sorted(builtin_problems()))
def test_built_in_problems_survive_a_round_trip(tmp_path, name):
    config = read_config(name)
    assert read_config(_write(tmp_path, to_toml(config))) == config


def test_gtoc7_is_the_published_problem(shared):
    problem = load_problem("gtoc7", shared / GTOC7_TABLE)
    assert (problem.m0, problem.spacecraft) == (2000.0, Spacecraft(800.0, 0.3, 3000.0))
    assert len(problem.catalogue) == 16256
    assert problem.max_duration_days == 6 * 365.25


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("min_stay_days", "min_stay_dayz", ["'min_stay_dayz'", "[mission]", "min_stay_days"]),
        ("[catalogue]", "[katalogue]", ["'katalogue'", "catalogue"]),
        ("thrust_n = 0.3", "", ["thrust_n", "spacecraft"]),
        ("thrust_n = 0.3", 'thrust_n = "x"', ["float", "spacecraft.thrust_n"]),
        ("thrust_n = 0.3", "thrust_n = 300000", ["thrust", "mN"]),
        ("thrust_n = 0.3", "thrust_n = nan", ["thrust", "finite number"]),
        ("isp_s = 3000", "isp_s = 29420", ["isp", "exhaust velocity"]),
        ("wet_mass_kg = 2000", "wet_mass_kg = -2000", ["wet mass", "more than zero"]),
        ("wet_mass_kg = 2000", "wet_mass_kg = 700", ["dry mass 800", "wet mass 700"]),
        ("dry_mass_kg = 800", "dry_mass_kg = -1", ["m_dry", "zero or more"]),
        ("[59215, 60000]", "[60000, 59215]", ["window", "before"]),
        ("max_duration_days = 700", "max_duration_days = 0", ["max_duration_days"]),
        ("min_stay_days = 30", "min_stay_days = 30\nstart_ids = [999]", ["999"]),
        ("[catalogue]", "[catalogue", ["not valid TOML"]),
        ("synthetic_bodies = 300", "", ["no asteroid table", "--catalogue"]),
        ("synthetic_bodies = 300", "synthetic_bodies = 1", ["catalogue.synthetic_bodies"]),
        ("synthetic_bodies = 300", 'file = "none.txt"', ["none.txt"]),
        ("[problem]", "[search]\nbeam_width = 0\n[problem]", ["beam_width"]),
        ("[problem]", "[search]\ntof_days_max = 10\n[problem]", ["tof_days_max"]),
    ],
)
def test_a_mistake_is_named_in_one_line(tmp_path, old, new, words):
    assert old in GOOD
    path = _write(tmp_path, GOOD.replace(old, new))
    with pytest.raises(InputError) as error:
        build_problem(read_config(path))
    message = str(error.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_missing_problem_names_the_built_in_ones():
    with pytest.raises(InputError, match="gtoc7"):
        read_config("gtoc77")


def test_an_empty_catalogue_is_refused():
    problem = small_problem()
    with pytest.raises(InputError, match="holds 0 bodies"):
        replace(problem, catalogue=problem.catalogue.select(np.arange(0)))


def test_a_catalogue_path_is_relative_to_its_file(tmp_path):
    config = read_config(
        _write(tmp_path, GOOD.replace("synthetic_bodies = 300", 'file = "a.txt"'))
    )
    assert config.catalogue.file == str(tmp_path / "a.txt")
    assert with_catalogue(config, "b.txt").catalogue.file == "b.txt"


def test_bodies_are_selected_and_units_stated_by_the_file(tmp_path):
    table = GOOD.replace("synthetic_bodies = 300", 'synthetic_bodies = 300\nselect = "a < 2.5"')
    problem = build_problem(read_config(_write(tmp_path, table)))
    assert 2 <= len(problem.catalogue) < 300
    assert problem.catalogue.elements[:, 0].max() < 2.5 * 1.496e11
    with pytest.raises(InputError, match="no column 'H'; columns are id, epoch, a"):
        build_problem(with_selection(read_config(_write(tmp_path, table)), "H < 16"))

    rows = "".join(f"{k} 61000 2.{k} 0.1 0.1 1 2 3\n" for k in range(1, 9))
    (tmp_path / "a.txt").write_text("id epoch a e i node argp M\n" + rows)
    stated = 'file = "a.txt"\nunits = {i = "rad"}\nselect = "i > 5 and id < 6"'
    config = read_config(_write(tmp_path, GOOD.replace("synthetic_bodies = 300", stated)))
    assert build_problem(config).catalogue.ids.tolist() == [1, 2, 3, 4, 5]
    assert with_catalogue(config, "b.txt").catalogue.select == "i > 5 and id < 6"
    assert read_config(_write(tmp_path, to_toml(config))) == config
    wrong = GOOD.replace("synthetic_bodies = 300", 'file = "a.txt"\nunits = {i = "grad"}')
    with pytest.raises(
        InputError, match=r"unit .grad. of column i is not known; expected deg, rad"
    ):
        build_problem(read_config(_write(tmp_path, wrong)))


def test_options_override_the_file():
    config = override(read_config("demo"), beam_width=7, pruner=None)
    assert config.search.beam_width == 7
    assert config.search.pruner == read_config("demo").search.pruner
    with pytest.raises(InputError, match="beam_width"):
        override(config, beam_width=0)


def test_the_grid_of_flight_times_includes_both_ends():
    settings = SearchSettings(tof_days_min=60, tof_days_max=120, tof_days_step=20)
    assert settings.tof_days().tolist() == [60, 80, 100, 120]


def test_pruner_specifications():
    assert len(parse_pruner("lambert:1.3,mima2:0.97").pruners) == 2
    assert parse_pruner("none").pruners == ()


@pytest.mark.parametrize("spec", ["mima3", "mima:x", "mima:-1", "mima:nan", "", "mima,,mima2"])
def test_bad_pruner_specifications_are_refused(spec):
    with pytest.raises(InputError, match="pruner"):
        parse_pruner(spec)


def test_the_page_on_problems_names_every_key_and_its_example_can_be_read(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "guide" / "problems.md").read_text()
    tables = {
        "problem": ProblemTable,
        "spacecraft": SpacecraftTable,
        "mission": MissionTable,
        "catalogue": CatalogueTable,
        "bodies": BodyTable,
        "fleet": FleetTable,
        "search": SearchSettings,
        "search.frontier": FrontierSettings,
        "search.scouts": ScoutSettings,
        "search.audit": AuditSettings,
    }
    top = {field.name for field in msgspec.structs.fields(Config)}
    assert {name for name in tables if "." not in name} == top
    tables |= {name: plugin.rules for name, plugin in plugins().items() if plugin.rules}
    parts = {field.name for field in msgspec.structs.fields(SearchSettings)} & {
        name.removeprefix("search.") for name in tables if "." in name
    }
    assert parts == {"frontier", "scouts", "audit"}
    for name, table in tables.items():
        heading = "[[bodies]]" if name == "bodies" else f"[{name}]"
        section = page.split(f"\n`{heading}`")[1].split("\n`[")[0].split("\n## ")[0]
        keys = {field.name for field in msgspec.structs.fields(table)}
        keys -= parts if name == "search" else set()
        documented = set(
            re.findall(r"`(\w+)`", "".join(re.findall(r"^\| (`.*?) \| ", section, re.M)))
        )
        assert documented == keys, name
    example = page.split("```toml\n")[1].split("```")[0]
    assert read_config(_write(tmp_path, example)).mission.start_ids == (1, 4, 10)
