"""Ends, bodies to visit and bodies of one's own in problem files."""

import re
from pathlib import Path

import numpy as np
import pytest

from feasibility import InputError
from feasibility.constants import AU
from feasibility.orbits import earth
from seqsearch.problems.problem_file import build_problem, read_config, to_toml
from tests.helpers.problem_texts import GOOD

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "guide" / "problems.md"
SHIP = """
[[bodies]]
name = "ship"
id = -1
a_au = 2.7
e = 0.1
i_deg = 5.0
node_deg = 10.0
argp_deg = 20.0
mean_anomaly_deg = 30.0
epoch_mjd = 2030-01-01
"""


def _config(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return read_config(str(path))


def _with(keys, bodies=SHIP):
    return GOOD.replace("[mission]", f"[mission]\n{keys}") + bodies


def test_the_example_of_the_guide_returns_to_the_earth(tmp_path):
    blocks = re.findall(r"^```toml\n(.*?)^```$", GUIDE.read_text(encoding="utf-8"), re.M | re.S)
    text = next(block for block in blocks if "earth = true" in block)
    ship = next(block for block in blocks if "mother ship" in block)
    problem = build_problem(_config(tmp_path, text + ship))
    assert problem.start_ids == (0,)
    assert problem.ending.row == problem.catalogue.rows_of([0])[0]
    assert problem.catalogue.ids[problem.ending.required].tolist() == [17]
    assert problem.unscored_ids == (0, -1)
    np.testing.assert_array_equal(
        problem.catalogue.elements[problem.ending.row], earth().elements[0]
    )


def test_a_body_of_its_own_is_where_its_elements_say(tmp_path):
    problem = build_problem(_config(tmp_path, _with("start_ids = [-1]\nend_id = -1")))
    row = problem.catalogue.rows_of([-1])[0]
    assert problem.catalogue.names[row] == "ship"
    np.testing.assert_allclose(
        problem.catalogue.elements[row],
        [2.7 * AU, 0.1, *np.radians([5.0, 10.0, 20.0, 30.0])],
    )
    rules = problem.tour_rules()
    assert rules.end_id == -1
    assert [body.name for body in rules.unscored] == ["ship"]


def test_files_with_ends_survive_a_round_trip(tmp_path):
    config = _config(tmp_path, _with("start_ids = [-1]\nend_id = -1\nmust_visit = [3]"))
    assert _config(tmp_path, to_toml(config)) == config


def test_bodies_that_count_are_visited_like_others(tmp_path):
    problem = build_problem(_config(tmp_path, _with("", SHIP + "scored = true\n")))
    assert problem.ending is None
    assert problem.unscored_ids == ()
    assert len(problem.rows_to_avoid) == 0


def test_a_sequence_need_not_name_start_and_end(tmp_path):
    text = _with("start_ids = [-1]\nend_id = -1\nsequence = [5, 7]")
    problem = build_problem(_config(tmp_path, text))
    ids = problem.catalogue.ids
    assert sorted(ids) == [-1, 5, 7]
    assert ids[problem.start_rows()].tolist() == [-1]
    node = problem.start_nodes(problem.start_rows(), np.array([9000.0]))
    allowed = problem.may_visit(node, np.arange(3)[None])
    assert ids[allowed[0]].tolist() == [5]


@pytest.mark.parametrize(
    ("keys", "bodies", "message"),
    [
        ("end_id = -2", SHIP, "id -2 is not in"),
        ("", SHIP + "earth = true\n", "earth = true and a_au"),
        ("", SHIP.replace("e = 0.1\n", ""), "no e, expected all of a_au"),
        ("", SHIP.replace("id = -1", "id = 5"), "id 5 is in"),
        ("must_visit = [-1]", SHIP, "body -1 is among must_visit, but"),
        ("end_id = 5\nmust_visit = [5]", SHIP, "body 5 is among must_visit, but"),
    ],
)
def test_mistakes_are_named(tmp_path, keys, bodies, message):
    with pytest.raises(InputError, match=re.escape(message)):
        build_problem(_config(tmp_path, _with(keys, bodies)))
