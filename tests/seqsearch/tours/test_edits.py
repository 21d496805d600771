"""Edits of a tour file: each is caught, or changes nothing that the verification relies on."""

import json

import numpy as np
import pytest

from feasibility import InputError
from seqsearch import read_tour, search, verify_tour
from seqsearch.tours.tour_files import to_json
from tests.helpers.problems import small_problem, small_settings

PHYSICS = {
    "departure a day later": (("legs", 0, "t_dep_mjd2000"), lambda x: x + 1.0),
    "flight a day longer": (("legs", 0, "tof_days"), lambda x: x + 1.0),
    "flight without time": (("legs", 1, "tof_days"), lambda _: 0.0),
    "flight back in time": (("legs", 1, "tof_days"), lambda x: -x),
    "flight without end": (("legs", 1, "tof_days"), lambda _: 1e12),
    "lighter start": (("legs", 0, "m0_kg"), lambda x: x - 1.0),
    "heavier start": (("legs", 0, "m0_kg"), lambda x: x + 1.0),
    "heavier end": (("legs", 0, "m_final_kg"), lambda x: x + 1.0),
    "mass from nothing": (("legs", 1, "m0_kg"), lambda x: x + 1.0),
    "heavier than can be flown": (("legs", 1, "m_star_kg"), lambda x: 0.5 * x),
    "no maximum mass": (("legs", 1, "m_star_kg"), lambda _: 0.0),
    "something dropped": (("legs", 0, "dropped_kg"), lambda _: 1.0),
    "something picked up": (("legs", 0, "dropped_kg"), lambda _: -1.0),
    "a launch": (("legs", 0, "dep_velocity_m_s"), lambda _: [100.0, 0.0, 0.0]),
    "a fly-by": (("legs", 0, "arr_velocity_m_s"), lambda _: [100.0, 0.0, 0.0]),
    "no impulse": (("legs", 0, "impulses"), lambda _: []),
    "an impulse less": (("legs", 0, "impulses"), lambda x: x[:-1]),
    "an impulse twice": (("legs", 0, "impulses"), lambda x: [*x, x[-1]]),
    "impulses in another order": (("legs", 0, "impulses"), lambda x: x[::-1]),
    "an impulse a day late": (("legs", 0, "impulses", 3, "t_mjd2000"), lambda x: x + 1.0),
    "an impulse never": (("legs", 0, "impulses", 3, "t_mjd2000"), lambda _: 1e15),
    "a stronger impulse": (("legs", 0, "impulses", 0, "dv_m_s", 0), lambda x: x + 1.0),
    "a huge impulse": (("legs", 0, "impulses", 0, "dv_m_s", 0), lambda _: 1e300),
    "a throttle above 1": (("legs", 0, "impulses", 0, "throttle", 0), lambda x: x + 2.0),
    "another throttle": (("legs", 0, "impulses", 0, "throttle", 0), lambda x: x + 0.1),
    "an impulse for free": (("legs", 0, "impulses", 0, "mass_after_kg"), lambda x: x + 1.0),
    "a mass before": (("legs", 0, "impulses", 1, "mass_before_kg"), lambda x: x + 1.0),
    "a mass of nothing": (("legs", 0, "impulses", 1, "mass_after_kg"), lambda _: 0.0),
    "another target": (("legs", 0, "to_id"), lambda x: x + 1),
    "another origin": (("legs", 1, "from_id"), lambda x: x + 1),
    "a leg less": (("legs",), lambda x: x[1:]),
    "a leg twice": (("legs",), lambda x: [*x, x[-1]]),
    "no leg": (("legs",), lambda _: []),
    "a body less": (("bodies",), lambda x: x[:-1]),
    "a body twice": (("bodies",), lambda x: [*x[:-1], x[0]]),
    "no body": (("bodies",), lambda _: []),
    "another body": (("bodies", 1, "id"), lambda x: x + 1),
    "a larger orbit": (("bodies", 1, "a_m"), lambda x: 1.001 * x),
    "no orbit": (("bodies", 1, "a_m"), lambda _: 0.0),
    "a rounder orbit": (("bodies", 1, "e"), lambda x: 0.9 * x),
    "a parabola": (("bodies", 1, "e"), lambda _: 1.0),
    "a hyperbola": (("bodies", 1, "e"), lambda _: 2.0),
    "another inclination": (("bodies", 1, "i_rad"), lambda x: x + 0.01),
    "another node": (("bodies", 1, "node_rad"), lambda x: x + 0.1),
    "another perihelion": (("bodies", 1, "argp_rad"), lambda x: x + 0.01),
    "another anomaly": (("bodies", 1, "mean_anomaly_rad"), lambda x: x + 0.01),
    "another epoch": (("bodies", 1, "epoch_mjd2000"), lambda x: x + 1.0),
    "an epoch without end": (("bodies", 1, "epoch_mjd2000"), lambda _: 1e300),
    "a better score": (("score",), lambda x: x + 1.0),
    "another format": (("format",), lambda _: "seqsearch-tour-3"),
}
"""What changes the flight: caught with the problem's rules, with the table and without."""

RULES = {
    "any window": (("rules", "first_departure_mjd2000"), lambda _: [-1e9, 1e9]),
    "a tiny dry mass": (("rules", "m_dry_kg"), lambda _: 1.0),
    "a heavy start": (("rules", "m0_kg"), lambda x: 2 * x),
    "ten times the thrust": (("rules", "thrust_n"), lambda x: 10 * x),
    "a better engine": (("rules", "isp_s"), lambda x: 2 * x),
    "years of time": (("rules", "max_duration_days"), lambda _: 9e9),
    "no stays": (("rules", "min_stay_days"), lambda _: 0.0),
    "another Sun": (("rules", "mu_m3_s2"), lambda x: 1.01 * x),
    "another gravity": (("rules", "g0_m_s2"), lambda x: 1.01 * x),
    "another score": (("rules", "score"), lambda _: {"kind": "mass-rate", "visits": 1}),
}
"""What the file says of its rules: it plays no part where the problem says them."""


@pytest.fixture(scope="module")
def problem():
    return small_problem()


@pytest.fixture(scope="module")
def text(problem):
    tour = search(problem, settings=small_settings(), rng=np.random.default_rng(4)).tour
    assert verify_tour(tour, problem.catalogue, problem.tour_rules()).passed
    return to_json(tour)


def _passes(document, path, problem, table):
    """Tell whether the file is verified; an error of more than a line counts as trust, too."""
    path.write_text(json.dumps(document))
    try:
        tour = read_tour(path)
    except InputError as error:
        return "\n" in str(error)
    return verify_tour(tour, problem.catalogue if table else None, problem.tour_rules()).passed


def _edited(text, place, change):
    document = json.loads(text)
    *way, last = place
    inner = document
    for step in way:
        inner = inner[step]
    inner[last] = change(inner[last])
    return document


@pytest.mark.parametrize("table", [True, False], ids=["table", "no-table"])
@pytest.mark.parametrize("edit", PHYSICS)
def test_what_changes_the_flight_is_caught(edit, table, text, problem, tmp_path):
    assert not _passes(_edited(text, *PHYSICS[edit]), tmp_path / "t.json", problem, table)


@pytest.mark.parametrize("edit", RULES)
def test_rules_in_the_file_play_no_part(edit, text, problem, tmp_path):
    assert _passes(_edited(text, *RULES[edit]), tmp_path / "t.json", problem, table=True)


def test_thrust_and_throttle_that_make_up_for_each_other_are_caught(text, problem, tmp_path):
    document = json.loads(text)
    document["rules"]["thrust_n"] *= 10.0
    for leg in document["legs"]:
        for impulse in leg["impulses"]:
            impulse["throttle"] = [x / 10.0 for x in impulse["throttle"]]
    assert not _passes(document, tmp_path / "t.json", problem, table=False)


def test_numbers_that_are_none_are_caught(text, problem, tmp_path):
    for place in (("legs", 0, "tof_days"), ("bodies", 0, "e"), ("rules", "mu_m3_s2")):
        for nothing in (float("nan"), float("inf"), None, "0.1", []):
            document = _edited(text, place, lambda _, nothing=nothing: nothing)
            assert not _passes(document, tmp_path / "t.json", problem, table=False)
