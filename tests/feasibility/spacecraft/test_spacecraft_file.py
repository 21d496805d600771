"""The TOML file of a user's spacecraft."""

from pathlib import Path

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


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml: cannot be read"):
        read_spacecraft(tmp_path / "none.toml")
