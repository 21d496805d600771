"""`check_problem`: our problems pass, and each breach of the contract is named in one line."""

import itertools
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
import pytest

from feasibility import FeasibilityClassifier, Spacecraft
from feasibility.orbits import synthetic_main_belt
from seqsearch import Problem, check_problem
from seqsearch.core.check_problem import ProblemContractError
from seqsearch.core.hops import Hops
from seqsearch.core.tree import FlownLeg
from seqsearch.tours.checks import Check
from seqsearch.tours.events import Groups
from tests.helpers.gtoc5 import toy_problem
from tests.helpers.predictors import Toy
from tests.helpers.problems import small_problem

GOOD = small_problem(catalogue=synthetic_main_belt(150, np.random.default_rng(3)))
FLOWN_BY = toy_problem()


@dataclass(frozen=True)
class _Changed:
    """A good problem of which one member is another: `change` of what was there."""

    good: Any
    member: str
    change: Any

    def __getattr__(self, name):
        if name.startswith("__") or name in self.__dataclass_fields__:
            raise AttributeError(name)
        value = getattr(self.good, name)
        if name != self.member:
            return value
        if callable(value):
            return lambda *arguments: self.change(value(*arguments), *arguments)
        return self.change(value)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"start_ids": tuple(GOOD.catalogue.ids[[3, 40]].tolist())},
        {"max_duration_days": 90.0, "min_stay_days": 0.0},
        {"first_departure_mjd2000": (8000.0, 8000.0)},
    ],
)
def test_tours_of_rendezvous_honour_the_contract(changes):
    problem = replace(GOOD, **changes)
    assert isinstance(problem, Problem)
    check_problem(problem, rng=np.random.default_rng(7))


def test_a_problem_with_moves_of_its_own_honours_the_contract():
    assert isinstance(FLOWN_BY, Problem)
    check_problem(FLOWN_BY, predictor=FeasibilityClassifier.load())


def _value(value):
    """Return a change that puts something else in the place of an attribute or an answer."""
    return _Value(value)


@dataclass(frozen=True)
class _Value:
    value: Any

    def __call__(self, *_):
        return self.value


# Changes of what the methods return; they stand in the module, as problems are pickled.


def _twice(rows):
    return np.concatenate([rows, rows])


def _small_ints(rows):
    return rows.astype(np.int32)


def _later(nodes, rows, t):
    return replace(nodes, t_ready_mjd2000=t + 1.0)


def _lighter(nodes, rows, t):
    return replace(nodes, mass=nodes.mass - 1.0)


def _one_dimension(nodes, rows, t):
    return replace(nodes, visited=rows)


def _elsewhere(nodes, rows, t):
    return replace(nodes, row=rows[::-1], visited=rows[::-1][:, None])


def _all_allowed(allowed, nodes, target):
    return np.ones_like(allowed)


def _as_numbers(allowed, nodes, target):
    return allowed.astype(float)


def _first_row_only(allowed, nodes, target):
    return allowed & (np.arange(len(allowed)) == 0)[:, None]


def _first_half_only(allowed, nodes, target):
    return allowed & (np.arange(allowed.shape[1]) < allowed.shape[1] // 2)


def _spoiling(allowed, nodes, target):
    target[:] = 0
    return allowed


_calls = itertools.count()


def _by_turns(allowed, nodes, target):
    return allowed & (next(_calls) % 2 == 0)


def _raising(answer, *_):
    raise ValueError("of two\nlines")


def _without_a_window(left, nodes, t_dep):
    return np.where(np.isinf(left), 5.0, left)


def _without_a_clock(left, nodes, t_dep):
    return np.where(np.isinf(left), left, GOOD.max_duration_days + 100.0)


def _growing(left, nodes, t_dep):
    return np.where(nodes.depth[:, None] > 0, np.arange(left.shape[1]) - 900.0, left)


def _unknown(left, nodes, t_dep):
    return np.where(np.isinf(left), np.nan, left)


def _compared(left, nodes, t_dep):
    return np.minimum(left, left.min(axis=0))


def _by_the_mean(cost, nodes, settings):
    return cost - cost.mean()


def _endless(cost, nodes, settings):
    return np.full_like(cost, np.inf)


def _legs(hops, k=0, **changes):
    legs = list(hops.legs)
    columns = dict(legs[k]._columns()) | changes
    legs[k] = type(legs[k])(**columns)
    return Hops(tuple(legs), hops.dropped_kg)


def _delayed(hops, *_):
    return _legs(hops, t_dep_mjd2000=hops.legs[0].t_dep_mjd2000 + 1.0)


def _a_day_later(hops, nodes, parent, target, t_dep, tof):
    return GOOD.hops(nodes, parent, target, t_dep + 1.0, tof)


def _a_day_longer(hops, nodes, parent, target, t_dep, tof):
    return GOOD.hops(nodes, parent, target, t_dep, tof + 1.0)


def _longer(hops, *_):
    return _legs(hops, tof_days=hops.legs[0].tof_days + 0.5)


def _astray(hops, *_):
    return _legs(hops, arr_id=hops.legs[0].dep_id)


def _from_elsewhere(hops, *_):
    return _legs(hops, dep_id=hops.legs[0].arr_id)


def _nowhere(hops, *_):
    return _legs(hops, rv_arr=hops.legs[0].rv_dep)


def _fast(hops, *_):
    return _legs(hops, rv_arr=hops.legs[0].rv_arr + np.array([0, 0, 0, 20.0, 0, 0]))


def _flying_start(hops, *_):
    return _legs(hops, rv_dep=hops.legs[0].rv_dep + np.array([0, 0, 0, 0, 20.0, 0]))


def _fuller(hops, *_):
    return _legs(hops, m0=hops.legs[0].m0 + 5.0)


def _stronger(hops, *_):
    return _legs(hops, thrust=2.0 * hops.legs[0].thrust)


def _anonymous(hops, *_):
    columns = dict(hops.legs[0]._columns())
    del columns["arr_id"]
    return Hops((type(hops.legs[0])(**columns),), hops.dropped_kg)


def _nothing_dropped(hops, *_):
    return Hops(hops.legs, ())


def _picked_up(hops, *_):
    return Hops(hops.legs, tuple(-1.0 - dropped for dropped in hops.dropped_kg))


def _only_legs(hops, *_):
    return hops.legs[0]


def _bundled(hops, *_):
    return _legs(hops, m_dry=np.linspace(800.0, 900.0, len(hops)))


def _none_raises(hops, nodes, parent, *_):
    parent.min()
    return hops


def _second_late(hops, *_):
    if len(hops.legs) == 1:
        return hops
    first = hops.legs[0]
    shorter = first.tof_days - 1.0
    bodies = FLOWN_BY.catalogue
    rv_arr = bodies.states_at(bodies.rows_of(first.arr_id), first.t_dep_mjd2000 + shorter)
    return _legs(hops, tof_days=shorter, rv_arr=rv_arr)


def _second_turned(hops, *_):
    if len(hops.legs) == 1:
        return hops
    second = hops.legs[1]
    return _legs(hops, 1, rv_dep=second.rv_dep + np.array([0, 0, 0, 3.0, 0, 0]))


def _rules(**changes):
    return _Rules(tuple(changes.items()))


@dataclass(frozen=True)
class _Rules:
    changes: tuple

    def __call__(self, rules, *_):
        return msgspec.structs.replace(rules, **dict(self.changes))


class _Nameless(msgspec.Struct, frozen=True, tag_field="kind", tag="nobody-knows"):
    """A tour event that no installed package brings."""

    @classmethod
    def forbidden(cls):
        return None

    def checks(self, flown, /):
        return [Check("nothing", True, "", "")]


def _closing_leg(**changes):
    return _ClosingLeg(tuple(changes.items()))


@dataclass(frozen=True)
class _ClosingLeg:
    changes: tuple

    def __call__(self, legs, row, t, mass):
        values = {
            "dep_row": row,
            "arr_row": row,
            "rv_dep": np.zeros(6),
            "rv_arr": np.zeros(6),
            "t_dep_mjd2000": t,
            "tof_days": 10.0,
            "m0": mass,
            "m_final": mass - 10.0,
            "m_star": mass + 1.0,
            "dropped": 0.0,
            "throttles": np.zeros((4, 3)),
            "mismatch": 0.0,
        }
        return (FlownLeg(**(values | dict(self.changes))),)


BREACHES = [
    ("name", _value(7), "name: is int, expected str"),
    ("spacecraft", _value((800, 0.3, 3000)), "spacecraft: is tuple"),
    ("spacecraft", _value(Spacecraft(2500.0, 0.3, 3000.0)), "m0: is 2000, expected more than 25"),
    ("min_stay_days", _value(-1.0), "min_stay_days: is -1"),
    ("max_duration_days", _value(np.inf), "max_duration_days: is inf"),
    ("first_departure_mjd2000", _value((8000.0, 7000.0)), "expected an earliest and a latest"),
    ("start_ids", _value((-5,)), "-5 is not in the catalogue"),
    ("start_rows", _twice, "start_rows: a row comes twice"),
    ("start_rows", _small_ints, "dtype int32, expected int64"),
    ("start_rows", _value(np.array([200])), "row 200 is not in the catalogue of 150"),
    ("start_rows", _value(np.zeros(0, dtype=np.intp)), "no rows"),
    ("start_nodes", _later, "t_ready_mjd2000 is not that of a start"),
    ("start_nodes", _lighter, "expected m0 = 2000 kg"),
    ("start_nodes", _one_dimension, "visited: returned shape (24,)"),
    ("start_nodes", _elsewhere, "not at the rows"),
    ("may_visit", _all_allowed, "a second time"),
    ("may_visit", _as_numbers, "dtype float64, expected bool"),
    ("may_visit", _first_row_only, "not row-wise"),
    ("may_visit", _first_half_only, "when the targets are reversed"),
    ("may_visit", _spoiling, "it changed its arguments"),
    ("may_visit", _by_turns, "two calls"),
    ("may_visit", _raising, "raised ValueError on 24 nodes: of two lines"),
    ("days_left", _without_a_window, "after the end of the window"),
    ("days_left", _without_a_clock, "days longer than max_duration_days"),
    ("days_left", _growing, "more time is left after a later departure"),
    ("days_left", _unknown, "NaN"),
    ("days_left", _compared, "not row-wise"),
    ("tour_cost", _by_the_mean, "not row-wise"),
    ("tour_cost", _endless, "returned inf"),
    ("hops", _only_legs, "returned Legs, expected Hops"),
    ("hops", _delayed, "begins"),
    ("hops", _a_day_later, " departs at 8"),
    ("hops", _a_day_longer, " arrives at 8"),
    ("hops", _longer, "km from its body"),
    ("hops", _astray, "does not arrive at its target"),
    ("hops", _from_elsewhere, "does not depart from the body"),
    ("hops", _nowhere, "ends"),
    ("hops", _fast, "arrives with 20 m/s"),
    ("hops", _flying_start, "departs with 20 m/s"),
    ("hops", _fuller, "its node has 2000 kg"),
    ("hops", _stronger, "not those of the spacecraft"),
    ("hops", _anonymous, "without t_dep_mjd2000, dep_id and arr_id"),
    ("hops", _nothing_dropped, "1 legs a hop and 0 masses"),
    ("hops", _picked_up, "expected 0 kg or more"),
    ("hops", _bundled, "not row-wise"),
    ("hops", _none_raises, "raised ValueError"),
    ("tour_rules", _value(None), "returned NoneType"),
    ("tour_rules", _rules(m0_kg=1999.0), "m0_kg is 1999.0, but the problem says 2000.0"),
    ("tour_rules", _rules(min_stay_days=0.0), "min_stay_days is 0.0"),
    ("tour_rules", _rules(events=(1,)), "int among the events is no TourEvent"),
    ("tour_rules", _rules(score=3), "score is int"),
    ("tour_rules", _rules(events=(_Nameless(),)), "'nobody-knows', known are drop"),
    ("tour_rules", _rules(events=(Groups(ids=((1,),), start_counts=True),)), "one body of each"),
    ("closing", _value(None), "returned NoneType, expected a tuple"),
    ("closing", _value((1,)), "leg 0 is int"),
    ("closing", _closing_leg(dep_row=149), "leaves row 149"),
    ("closing", _closing_leg(t_dep_mjd2000=1.0), "departs at 1 MJD2000"),
    ("closing", _closing_leg(m0=9000.0), "departs with 9000 kg"),
    ("closing", _closing_leg(m_final=9000.0), "ends with 9000 kg, more"),
    ("closing", _closing_leg(tof_days=0.0), "takes no time"),
    ("closing", _closing_leg(throttles=np.ones((4, 3))), "a throttle of 1.7"),
    ("closing", _closing_leg(throttles=np.ones(3)), "throttles of shape (3,)"),
    ("closing", _closing_leg(m_final=300.0), "below the dry mass"),
    ("custom_moves", _value(3), "int has not both of starts and candidates"),
]


def _breach(problem, **options):
    with pytest.raises(ProblemContractError) as caught:
        check_problem(problem, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize(("member", "change", "words"), BREACHES)
def test_each_breach_of_the_contract_is_named_in_one_line(member, change, words):
    message = _breach(_Changed(GOOD, member, change))
    assert words in message
    assert message.startswith("_Changed.")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_second_late, "legs[1]: begins 1 days off"),
        (_second_turned, "3 m/s off the state"),
        (_rules(start_counts=True), "which is no visit"),
    ],
)
def test_the_second_leg_and_a_launch_are_looked_at_too(change, words):
    member = "tour_rules" if isinstance(change, _Rules) else "hops"
    assert words in _breach(_Changed(FLOWN_BY, member, change))


def test_a_missing_member_and_what_cannot_be_pickled_are_named():
    assert _breach(object()).startswith("object: has no name, catalogue, spacecraft, m0")
    assert "not picklable" in _breach(_Changed(GOOD, "name", lambda name: name))


@dataclass
class _Forgetful:
    """Loses what it knows on its way to another process."""

    good: Any
    allowed: bool = True

    def __getattr__(self, name):
        if name.startswith("__") or name in ("good", "allowed"):
            raise AttributeError(name)
        return getattr(self.good, name)

    def may_visit(self, nodes, target, /):
        return self.good.may_visit(nodes, target) & self.allowed

    def __getstate__(self):
        return {"good": self.good, "allowed": False}


def test_a_copy_that_answers_differently_is_found():
    assert "a pickled and restored copy answers differently" in _breach(_Forgetful(GOOD))


# Moves of the problem's own


@dataclass(frozen=True)
class _Moves:
    """The moves of the toy, of which the candidates are changed."""

    change: Any

    def starts(self, settings, rng, /):
        return FLOWN_BY.starts(settings, rng)

    def candidates(self, nodes, settings, predictor, threads, /):
        yield from self.change(
            list(FLOWN_BY.candidates(nodes, settings, predictor, threads)), threads
        )


@dataclass(frozen=True)
class _EarlyStarts:
    def starts(self, settings, rng, /):
        nodes = FLOWN_BY.starts(settings, rng)
        t = nodes.t_arr_mjd2000 - 5000.0
        return replace(nodes, t_ready_mjd2000=t, t_arr_mjd2000=t, t_first_mjd2000=t)

    def candidates(self, nodes, settings, predictor, threads, /):
        yield from ()


def _backwards(parts, threads):
    return parts[::-1]


def _stranger(parts, threads):
    return [replace(part, parent=part.parent + 900) for part in parts]


def _weightless(parts, threads):
    return [replace(part, m_final=np.zeros(len(part.hops))) for part in parts]


def _counted(parts, threads):
    return [replace(part, m_final=part.m_final + threads) for part in parts]


def _mistaken(parts, threads):
    return [replace(part, target=part.target[::-1]) for part in parts]


def _bare(parts, threads):
    return [part.hops for part in parts]


def _hollow(parts, threads):
    none = np.zeros(0, dtype=np.intp)
    return [
        replace(part, parent=none, target=none, hops=part.hops.take(none), m_final=np.zeros(0))
        for part in parts
    ]


@pytest.mark.parametrize(
    ("moves", "words"),
    [
        (_EarlyStarts(), "starts: node 0 starts at"),
        (_Moves(_backwards), "not ordered by node"),
        (_Moves(_stranger), "parent: not all are 0 to 2"),
        (_Moves(_weightless), "m_final: not all are more than 0 kg"),
        (_Moves(_counted), "two threads find something else"),
        (_Moves(_mistaken), "does not arrive at its target"),
        (_Moves(_bare), "yields Hops, expected CustomCandidates"),
        (_Moves(_hollow), "yields no hops"),
    ],
)
def test_breaches_of_own_moves_are_named_in_one_line(moves, words):
    problem = _Changed(FLOWN_BY, "custom_moves", _Value(moves))
    assert words in _breach(problem, predictor=Toy())


def _without_the_near(allowed, nodes, target):
    return allowed & (target % 2 == 0)


def _less_time(left, nodes, t_dep):
    return left - 800.0


@pytest.mark.parametrize(
    ("member", "change", "words"),
    [
        ("may_visit", _without_the_near, "which may_visit forbids"),
        ("days_left", _less_time, "days longer than days_left says"),
    ],
)
def test_own_moves_keep_to_what_the_problem_allows(member, change, words):
    assert words in _breach(_Changed(FLOWN_BY, member, change), predictor=Toy())
