"""What a problem's tours have to respect, as their file says it."""

import tempfile
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from feasibility import InputError
from seqsearch.core.contract.asking import Asked, one_line
from seqsearch.core.nodes import Nodes
from seqsearch.core.recording import tour_body
from seqsearch.tours.checks import Check, FlownTour
from seqsearch.tours.events.launch import Launch
from seqsearch.tours.events.protocol import TourEvent
from seqsearch.tours.scores.protocol import ScoreRule
from seqsearch.tours.tour import Tour, TourRules
from seqsearch.tours.tour_files import read_tour, to_json

_MEMBER = "tour_rules"


def check_rules(asked: Asked, starts: Nodes) -> None:
    """Raise ProblemContractError where the rules are not those of the problem.

    Parameters
    ----------
    asked : Asked
        The problem.
    starts : Nodes
        Legal starts; a tour that goes no further breaks none of the rules.
    """
    rules = asked.ask(_MEMBER)
    _check_numbers(asked, rules)
    _check_kinds(asked, rules)
    row, epoch = int(starts.row[0]), float(starts.t_arr_mjd2000[0])
    body = tour_body(asked.problem.catalogue, row)
    tour = Tour(rules=rules, t_start_mjd2000=epoch, bodies=(body,), legs=(), score=0.0)
    try:
        score = rules.score.score(tour.visits, ())
    except Exception as error:
        raise asked.breach(
            _MEMBER, f"score raised {type(error).__name__} on a tour without legs: {error}"
        ) from error
    if not (isinstance(score, float) and np.isfinite(score)):
        raise asked.breach(_MEMBER, f"score of a tour without legs is {score!r}")
    tour = msgspec.structs.replace(tour, score=score)
    _check_file(asked, tour)
    for event in rules.events:
        _check_event(asked, event, FlownTour(tour.bodies, (), ()))


def _check_event(asked: Asked, event: TourEvent, flown: FlownTour) -> None:
    """Check that an event has checks, which a tour passes that only starts."""
    kind = type(event).__name__
    try:
        checks = event.checks(flown)
    except Exception as error:
        raise asked.breach(
            _MEMBER,
            f"{kind}.checks raised {type(error).__name__} on a tour without legs: "
            f"{one_line(error)}",
        ) from error
    if not checks or not all(isinstance(check, Check) for check in checks):
        raise asked.breach(_MEMBER, f"{kind}.checks returned {checks}, expected a list of Check")
    for check in checks:
        if not check.passed:
            raise asked.breach(
                _MEMBER,
                f"a tour that only starts fails the check {check.name!r} "
                f"({check.found}, limit {check.limit})",
            )


def _check_numbers(asked: Asked, rules: Any) -> None:
    """Check that the rules say what the problem says."""
    if not isinstance(rules, TourRules):
        raise asked.breach(_MEMBER, f"returned {type(rules).__name__}, expected TourRules")
    problem = asked.problem
    craft = problem.spacecraft
    said = {
        "name": problem.name,
        "m0_kg": problem.m0,
        "m_dry_kg": craft.m_dry,
        "thrust_n": craft.thrust,
        "isp_s": craft.isp,
        "first_departure_mjd2000": problem.first_departure_mjd2000,
        "max_duration_days": problem.max_duration_days,
        "min_stay_days": problem.min_stay_days,
        "start_ids": problem.start_ids,
    }
    for name, value in said.items():
        found = getattr(rules, name)
        if found != value:
            raise asked.breach(_MEMBER, f"{name} is {found}, but the problem says {value}")


def _check_kinds(asked: Asked, rules: TourRules) -> None:
    """Check that events and score are what they should be."""
    for event in rules.events:
        if not isinstance(event, TourEvent):
            raise asked.breach(_MEMBER, f"{type(event).__name__} among the events is no TourEvent")
    if not isinstance(rules.score, ScoreRule):
        raise asked.breach(
            _MEMBER, f"score is {type(rules.score).__name__}, which is no ScoreRule"
        )
    launched = any(isinstance(event, Launch) and event.planet for event in rules.events)
    if launched and rules.start_counts:
        raise asked.breach(
            _MEMBER, "start_counts, but tours are launched from a planet, which is no visit"
        )


def _check_file(asked: Asked, tour: Tour) -> None:
    """Check that a tour survives being written and read."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sequence.json"
        try:
            path.write_text(to_json(tour), encoding="utf-8")
            read = read_tour(path)
        except InputError as error:
            how = one_line(error).removeprefix(f"{path}: ")
            raise asked.breach(_MEMBER, f"a tour file cannot be read back ({how})") from error
        except Exception as error:
            raise asked.breach(
                _MEMBER,
                f"a tour file cannot be written ({type(error).__name__}: {one_line(error)})",
            ) from error
    if read != tour:
        raise asked.breach(_MEMBER, "a tour that is written and read back is another one")
