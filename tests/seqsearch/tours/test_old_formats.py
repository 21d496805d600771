"""Files of version 0.1: tours and settings are read, checkpoints are refused by their version."""

import json
from pathlib import Path

import pytest

from feasibility import InputError
from seqsearch import read_tour, verify_tour
from seqsearch.beam.state import SearchState
from seqsearch.problems.problem_file import read_config, to_toml
from seqsearch.runs.checkpoint import FOLDER, Checkpoints, Origin
from seqsearch.settings import SearchSettings
from seqsearch.tours.events import Drop, FlyBy, Launch
from seqsearch.tours.scores import Points, VisitCount
from seqsearch.tours.tour import FORMAT
from seqsearch.tours.tour_files import to_json
from tests.helpers.gtoc5 import near_earth_bodies, toy_problem
from tests.helpers.problem_texts import GOOD
from tests.helpers.problems import small_problem

DATA = Path(__file__).resolve().parents[2] / "data"
RENDEZVOUS = DATA / "rendezvous_format_1.json"
GTOC5 = DATA / "gtoc5_format_1.json"
"""Tours that version 0.1 found for the small problems of `tests.helpers`."""


def test_a_tour_of_rendezvous_of_version_0_1_is_read_verified_and_scored():
    tour = read_tour(RENDEZVOUS)
    problem = small_problem(max_duration_days=500.0)
    assert tour.format == FORMAT
    assert tour.rules == problem.tour_rules()
    assert tour.rules.score == VisitCount()
    assert (tour.score, len(tour.legs)) == (3.0, 2)
    verification = verify_tour(tour, problem.catalogue, problem.tour_rules())
    assert verification.passed, verification.table()


def test_a_tour_with_fly_bys_of_version_0_1_is_read_verified_and_scored():
    tour = read_tour(GTOC5)
    assert [type(event) for event in tour.rules.events] == [Launch, FlyBy, Drop]
    assert isinstance(tour.rules.score, Points)
    assert tour.rules == toy_problem().tour_rules()
    assert (tour.n_asteroids, len(tour.legs)) == (4, 8)
    assert tour.score == pytest.approx(4.0)
    verification = verify_tour(tour, near_earth_bodies(), toy_problem().tour_rules())
    assert verification.passed, verification.table()


@pytest.mark.parametrize("path", [RENDEZVOUS, GTOC5], ids=lambda path: path.stem)
def test_what_was_read_is_written_in_the_present_format(path, tmp_path):
    tour = read_tour(path)
    (tmp_path / "sequence.json").write_text(to_json(tour))
    assert read_tour(tmp_path / "sequence.json") == tour


def _changed(tmp_path, source, change):
    record = json.loads(source.read_text())
    change(record)
    path = tmp_path / "sequence.json"
    path.write_text(json.dumps(record))
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda record: record["rules"].update(gtoc9={"debris": 1}),
            ["seqsearch-tour-1", "version 0.1", "'gtoc9'", "no installed package"],
        ),
        (lambda record: record["rules"].update(gtoc5={"debris": 1}), ["debris"]),
        (lambda record: record.update(bodies=[]), ["without a body"]),
        (lambda record: record.update(rules=None), ["not a complete"]),
        (
            lambda record: record.update(format="seqsearch-tour-9"),
            ["format 'seqsearch-tour-9'", "expected 'seqsearch-tour-2'"],
        ),
    ],
)
def test_a_tour_with_rules_that_nobody_knows_is_refused_in_one_line(tmp_path, change, words):
    path = _changed(tmp_path, GTOC5, change)
    with pytest.raises(InputError) as caught:
        read_tour(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_checkpoint_of_version_0_1_is_refused_by_its_version(tmp_path):
    origin = Origin(
        seed=0, time_limit_s=None, max_solves=None, config_sha256="", catalogue_sha256=""
    )
    Checkpoints.begin(tmp_path, origin, SearchState(settings=SearchSettings()))
    file = tmp_path / FOLDER / "origin.ckpt"
    head, rest = file.read_bytes().split(b"\n", 1)
    file.write_bytes(b"seqsearch checkpoint 2\n" + rest)
    with pytest.raises(InputError) as caught:
        Checkpoints.load(tmp_path)
    message = str(caught.value)
    assert message.startswith(f"{file}: written by another version ('seqsearch checkpoint 2')")
    assert f"this program reads '{head.decode()}'" in message
    assert "\n" not in message


OLD_KEYS = """
[search]
frontier = "time"
slice_days = 30
max_per_cell = 2
scout_generations = 3
scout_share = 0.5
audit_per_rank = 7
beam_width = 5
"""


def test_settings_of_version_0_1_are_read_into_the_tables_where_they_are_now(tmp_path):
    path = tmp_path / "old.toml"
    path.write_text(GOOD + OLD_KEYS)
    config = read_config(str(path))
    expected = SearchSettings().with_(
        beam_width=5,
        frontier={"kind": "time", "slice_days": 30.0, "max_per_cell": 2},
        scouts={"generations": 3, "share": 0.5},
        audit={"per_rank": 7},
    )
    assert config.search == expected
    path.write_text(to_toml(config))
    assert "audit_per_rank" not in path.read_text()
    assert read_config(str(path)) == config


def test_an_old_key_beside_the_new_one_and_an_old_value_out_of_range_are_named(tmp_path):
    path = tmp_path / "old.toml"
    path.write_text(GOOD + "[search]\naudit_per_rank = 7\n[search.audit]\nper_rank = 8\n")
    with pytest.raises(InputError, match=r"'audit_per_rank' of version 0\.1.*\[search\.audit\]"):
        read_config(str(path))
    path.write_text(GOOD + "[search]\naudit_per_rank = -7\n")
    with pytest.raises(InputError, match=r"search\.audit\.per_rank"):
        read_config(str(path))
