"""The TOML file of a user's spacecraft."""

from pathlib import Path

import msgspec
import pytest

from feasibility import InputError
from feasibility.spacecraft.spacecraft_file import EXAMPLE, Sampling, read_spacecraft

LEAST = "dry_mass_kg = 500\nthrust_n = 0.1\nisp_s = 2500\nm0_kg = [600, 900]\n"


def read(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return read_spacecraft(path)


def test_the_example_says_what_the_defaults_are(tmp_path):
    craft = read(tmp_path, EXAMPLE)
    assert craft.sampling == Sampling()
    assert (craft.thrust_n, craft.isp_s, craft.m0_kg) == (0.3, 3000.0, (800.0, 2000.0))


def test_the_document_shows_the_example():
    document = Path(__file__).parents[3] / "docs" / "guide" / "spacecraft.md"
    assert EXAMPLE in document.read_text(encoding="utf-8")


def test_four_keys_are_enough_and_legs_are_those_of_the_spacecraft(tmp_path):
    made = read(tmp_path, LEAST).protocols("belt.txt")
    assert {kind: share for kind, (_, share) in made.items()} == {"search": 0.5, "pairs": 0.5}
    for protocol, _ in made.values():
        craft = protocol.craft()
        assert (craft.m_dry, craft.thrust, craft.isp) == (500.0, 0.1, 2500.0)
        assert protocol.sampler.m0_kg == (600.0, 900.0)
        assert protocol.catalogue.file == "belt.txt"
        assert protocol.boundary_share == 0.5


def test_the_sampling_goes_where_it_belongs(tmp_path):
    text = LEAST + "[sampling]\ntof_days = [100, 700]\nsearch_share = 1.0\nboundary_sigma = 0.1\n"
    made = read(tmp_path, text).protocols(None)
    assert list(made) == ["search"]
    protocol, share = made["search"]
    assert share == 1.0
    assert protocol.sampler.tof_days == (100.0, 700.0)
    assert protocol.boundary_sigma == 0.1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("thrust_n = ", "not valid TOML"),
        (LEAST + "wings = 2", "unknown key 'wings' at top level; known keys are dry_mass_kg"),
        (LEAST + "[sampling]\nwings = 2", r"unknown key 'wings' in \[sampling\]; known keys are"),
        (LEAST.replace("isp_s = 2500", ""), "no key 'isp_s'"),
        (LEAST.replace("2500", "-1"), "at isp_s"),
        (LEAST.replace("2500", '"fast"'), "at isp_s"),
        (LEAST.replace("600", "400"), "m0_kg begins at 400, below dry_mass_kg = 500"),
        (LEAST.replace("600", "1000"), "expected the smaller number first"),
        (LEAST + "[sampling]\ntof_days = [9, 2]", "expected the smaller number first"),
    ],
)
def test_what_cannot_be_used_is_one_line_that_names_file_and_key(tmp_path, text, message):
    with pytest.raises(InputError, match=f"mine.toml: .*{message}") as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)


TABLE = "[spacecraft]\nwet_mass_kg = 900\ndry_mass_kg = 500\nthrust_n = 0.1\nisp_s = 2500\n"


def test_the_table_of_problem_files_is_read(tmp_path):
    craft = read(tmp_path, TABLE)
    assert (craft.dry_mass_kg, craft.thrust_n, craft.isp_s) == (500.0, 0.1, 2500.0)
    assert craft.m0_kg == (500.0, 900.0)
    narrower = read(tmp_path, 'name = "mine"\n' + TABLE + "m0_kg = [600, 900]\n[sampling]\n")
    assert (narrower.name, narrower.m0_kg) == ("mine", (600.0, 900.0))
    assert narrower == msgspec.structs.replace(read(tmp_path, LEAST), name="mine")
    assert read(tmp_path, TABLE.replace("500", "0")).m0_kg == (90.0, 900.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("thrust_n = 1\n" + TABLE, r"thrust_n at top level beside \[spacecraft\]"),
        (TABLE.replace("wet_mass_kg = 900\n", ""), r"no key 'wet_mass_kg'.*at spacecraft"),
        (TABLE + "wings = 2", r"unknown key 'wings' in \[spacecraft\]"),
        (TABLE.replace("900", "400"), "wet_mass_kg = 400, expected more than dry_mass_kg"),
        (TABLE + "m0_kg = [600, 1000]", "m0_kg ends at 1000, above wet_mass_kg = 900"),
        (TABLE.replace("0.1", "100.0"), r"100 N on 500 kg is 0.2 m/s2.*is it in mN\?"),
        (LEAST.replace("0.1", "100.0"), r"100 N on 500 kg is 0.2 m/s2.*is it in mN\?"),
        (LEAST.replace("0.1", "8.0"), r"thrust_n: 8 N on 600 kg is 0.013 m/s2"),
        (LEAST.replace("2500", "29420"), r"is it in m/s, an exhaust velocity\?"),
        (LEAST.replace("900", "1e300"), "m0_kg = .*expected at most 1e.07"),
        (LEAST + "[sampling]\nstart_mjd = [2458849.5, 2460000.5]", r"is it a Julian date\?"),
        (LEAST + "[sampling]\nneighbours = 1000000000000", "at sampling.neighbours"),
        (LEAST + "[sampling]\ntof_days_max = 1e300", "at sampling.tof_days_max"),
    ],
)
def test_slips_and_absurd_numbers_are_one_line(tmp_path, text, message):
    with pytest.raises(InputError, match=f"mine.toml: .*{message}") as caught:
        read(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml: cannot be read"):
        read_spacecraft(tmp_path / "none.toml")
