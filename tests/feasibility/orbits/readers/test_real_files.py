"""Files of the publishers themselves, where they lie beside the checkout."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from feasibility.orbits.tables import read_bodies


@pytest.fixture
def real(shared):
    path = shared / "real"
    if not path.is_dir():
        pytest.skip("the publishers' own files (../shared/real) are not here")
    return path


def test_mpcorb(real):
    table = read_bodies(real / "mpcorb_excerpt.dat")
    assert table.names[0] == "1 Ceres"
    assert table.orbits[0].tolist() == [
        *(59000.0, 2.7676569, 0.0775571, 10.58862, 80.28698, 73.73161, 162.68631)
    ]
    lines = (real / "mpcorb_lines.txt").read_text().splitlines()
    table = read_bodies(real / "mpcorb_lines.txt")
    assert len(table) == len(lines) == 804
    columns = ((92, 103), (70, 79), (59, 68), (48, 57), (37, 46), (26, 35))
    expected = [[float(line[begin:end]) for begin, end in columns] for line in lines]
    assert_array_equal(table.orbits[:, 1:], expected)
    assert list(table.names) == [line[166:194].strip() for line in lines]


def test_extended_json_and_look_ups(real):
    plain = json.loads((real / "mpc_extended_mini.json").read_text())
    table = read_bodies(real / "mpc_extended_mini.json")
    members = ("a", "e", "i", "Node", "Peri", "M")
    assert_array_equal(table.orbits[:, 1:], [[body[k] for k in members] for body in plain])
    assert_array_equal(table.orbits[:, 0], 58700.0)
    for name, number in (("ceres", 1), ("apophis", 99942)):
        orbit = json.loads((real / f"sbdb_lookup_{name}.json").read_text())["orbit"]
        given = {part["name"]: float(part["value"]) for part in orbit["elements"]}
        table = read_bodies(real / f"sbdb_lookup_{name}.json")
        assert_array_equal(
            table.orbits[0, 1:], [given[k] for k in ("a", "e", "i", "om", "w", "ma")]
        )
        assert table.orbits[0, 0] == float(orbit["epoch"]) - 2_400_000.5
        assert table.ids.tolist() == [number]


def test_horizons_elements_and_vectors_agree(real):
    elements = read_bodies(real / "horizons_ceres_elements_range.txt")
    vectors = read_bodies(real / "horizons_ceres_vectors_range.txt")
    assert_array_equal(
        elements.orbits[0],
        [
            *(59740.0, 2.766380805878023, 7.857509431507990e-02, 1.058712597794349e01),
            *(8.026775296710701e01, 7.356968535036279e01, 3.214371287399738e02),
        ],
    )
    assert_allclose(vectors.orbits, elements.orbits, rtol=1e-9)
    assert np.isfinite(vectors.catalogue("x").states(0.0)).all()
