"""Problems, events and scores of somebody else's package, and plug-ins that cannot be used."""

import json

import pytest

from tests.helpers.plugins import install, install_pilgrimage, run_with

CHECK = """
import numpy as np
from feasibility.orbits import synthetic_main_belt
from seqsearch import check_problem, load_problem
problem = load_problem("pilgrimage")
check_problem(problem)
print(type(problem).__module__, problem.rules)
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    site = tmp_path_factory.mktemp("site")
    install_pilgrimage(site)
    return site


@pytest.fixture(scope="module")
def run(site):
    """A run of the plug-in's problem."""
    done = run_with(site, "-m", "seqsearch", "run", "pilgrimage", "--workers", "1", "--seed", "2")
    assert done.returncode == 0, done.stderr
    assert " pilgrims, " in done.stdout
    return site / "runs" / "pilgrimage"


def _ids(run):
    tour = json.loads((run / "sequence.json").read_text())
    return [body["id"] for body in tour["bodies"]]


def test_a_plug_in_is_listed_and_printed_as_any_other_problem(site):
    listed = run_with(site, "-m", "seqsearch", "problems")
    assert "pilgrimage   upwards, ever upwards" in listed.stdout
    assert "demo" in listed.stdout
    printed = run_with(site, "-m", "seqsearch", "problems", "pilgrimage")
    assert "toll = 0.25" in printed.stdout


def test_its_problem_honours_the_contract(site):
    done = run_with(site, "-c", CHECK)
    assert done.returncode == 0, done.stderr
    assert "pilgrimage.problem PilgrimageRules(toll=0.25, longest_step=1200)" in done.stdout


def test_its_own_rule_shapes_the_tour_and_its_own_check_verifies_it(site, run):
    ids = _ids(run)
    assert len(ids) >= 3
    assert ids == sorted(ids)
    done = run_with(site, "-m", "seqsearch", "verify", str(run))
    assert done.returncode == 0, done.stdout
    assert "ok    ids ascend" in done.stdout
    merit = len(ids) - 0.25 * (len(ids) - 1)
    assert f"{merit:.6f}  (limit: {merit:.6f} pilgrims)" in done.stdout


def test_its_event_and_score_survive_the_tour_file(run):
    rules = json.loads((run / "sequence.json").read_text())["rules"]
    assert rules["events"] == [{"kind": "ascending", "longest_step": 1200}]
    assert rules["score"] == {"kind": "after-toll", "toll": 0.25}


def test_a_tour_that_breaks_the_rule_of_its_event_is_not_verified(site, run):
    stricter = (run / "config.toml").read_text().replace("longest_step = 1200", "longest_step = 1")
    (site / "stricter.toml").write_text(stricter)
    done = run_with(site, "-m", "seqsearch", "verify", str(run), "--problem", "stricter.toml")
    assert done.returncode == 1
    assert "FAIL  ids ascend" in done.stdout
    assert done.stdout.count("FAIL") == 1


def test_a_run_with_a_plug_in_is_resumed_to_the_same_tour(site, run):
    whole = (run / "sequence.json").read_bytes()
    done = run_with(
        site, "-m", "seqsearch", "resume", str(run), "--from-rank", "1:1", "--workers", "1"
    )
    assert done.returncode == 0, done.stderr
    assert (run / "sequence.json").read_bytes() == whole


def test_without_the_package_its_tours_and_problem_files_are_refused_by_name(run, tmp_path):
    done = run_with(tmp_path, "-m", "seqsearch", "verify", str(run))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith(
        f"seqsearch: {run}/sequence.json: event of kind 'ascending', known are drop, fly-by"
    )
    done = run_with(tmp_path, "-m", "seqsearch", "run", str(run / "config.toml"), "--out", "no")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "'pilgrimage'" in done.stderr


RULES = "import msgspec\nclass RULES(msgspec.Struct, frozen=True): ...\n"
BUILD = "def build(base, rules): return base\n"


@pytest.mark.parametrize(
    ("name", "files", "words"),
    [
        (
            "other",
            {"__init__.py": "import nowhere"},
            ["other: broken cannot be loaded", "No module named 'nowhere'"],
        ),
        (
            "other",
            {"__init__.py": "1 / 0"},
            ["other: broken cannot be loaded (ZeroDivisionError"],
        ),
        ("other", {"__init__.py": RULES}, ["other: broken has one of RULES and build"]),
        ("other", {"__init__.py": BUILD}, ["other: broken has one of RULES and build"]),
        ("other", {"__init__.py": BUILD + "RULES = {}"}, ["RULES of broken is no msgspec.Struct"]),
        ("demo", {"__init__.py": ""}, ["plug-in demo: two installed packages bring one"]),
        (
            "other",
            {"__init__.py": "", "demo.toml": "[problem]"},
            ["problem demo: two installed plug-ins have one"],
        ),
        ("my-other", {"__init__.py": ""}, ["my-other: expected a name of letters"]),
        ("search", {"__init__.py": RULES + BUILD}, ["plug-in search: expected another name"]),
    ],
)
def test_a_plug_in_that_cannot_be_used_is_named_in_one_line(tmp_path, name, files, words):
    install(tmp_path, "broken", f"[seqsearch.problems]\n{name} = broken\n", files)
    done = run_with(tmp_path, "-m", "seqsearch", "problems")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert done.stderr.startswith("seqsearch: problem ")
    for part in words:
        assert part in done.stderr


def test_a_problem_file_with_the_rules_of_two_plug_ins_is_refused(site):
    text = (site / "pilgrimage" / "pilgrimage.toml").read_text()
    (site / "both.toml").write_text(text + "[gtoc5]\n")
    done = run_with(site, "-m", "seqsearch", "run", "both.toml", "--out", "both")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert "tables [gtoc5] and [pilgrimage], expected the rules of one problem" in done.stderr


KIND = """
import msgspec
class Kind(msgspec.Struct, frozen=True, tag_field="kind", tag="mine"):
    def checks(self, flown, /):
        return []
    @classmethod
    def forbidden(cls):
        return None
"""


@pytest.mark.parametrize("group", ["events", "scores"])
@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("mine = broken:Missing", "'mine' of seqsearch.{}: broken:Missing cannot be loaded"),
        ("other = broken:Kind", "'other' of seqsearch.{}: broken:Kind has the tag 'mine'"),
        ("{} = broken:Kind", "broken:Kind brings a kind that there is already"),
    ],
)
def test_a_kind_that_cannot_be_used_is_named_in_one_line(site, run, tmp_path, group, entry, words):
    taken = {"events": "drop", "scores": "visits"}[group]
    entries = f"[seqsearch.{group}]\n{entry.format(taken)}\n"
    install(tmp_path, "broken", entries, {"__init__.py": KIND})
    record = json.loads((run / "sequence.json").read_text())
    record["rules"] |= {"events": [], "score": {"kind": "visits"}}
    (tmp_path / "sequence.json").write_text(json.dumps(record))
    done = run_with(tmp_path, "-m", "seqsearch", "verify", "sequence.json")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert words.format(group) in done.stderr
