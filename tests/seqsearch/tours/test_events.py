"""Tour events and score rules: kept and broken, forbidden, and kinds that nobody knows."""

import json

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility import InputError
from seqsearch.tours.checks import Arrival, FlownTour
from seqsearch.tours.events import Drop, FlyBy, Groups, Launch, TourEvent, event_kinds, make_event
from seqsearch.tours.records import Impulse, TourBody, TourLeg
from seqsearch.tours.scores import MassRate, Points, ScoreRule, VisitCount, make_score, score_kinds
from seqsearch.tours.tour import Tour, TourRules
from seqsearch.tours.tour_files import read_tour, to_json

PLANET = TourBody(
    id=0,
    name="Earth",
    epoch_mjd2000=0.0,
    a_m=1.5e11,
    e=0.0167,
    i_rad=1e-5,
    node_rad=3.0,
    argp_rad=5.0,
    mean_anomaly_rad=6.2,
)

_COAST = Impulse(
    t_mjd2000=8005.0,
    dv_m_s=(0.0, 0.0, 0.0),
    throttle=(0.0, 0.0, 0.0),
    mass_before_kg=1000.0,
    mass_after_kg=1000.0,
)


def _body(body_id):
    return msgspec.structs.replace(PLANET, id=body_id, name=f"body {body_id}")


def _leg(to_id, from_id=0, t_dep=8000.0, tof=10.0, speed=0.0, launch=0.0, dropped=0.0, m=1000.0):
    """Return a leg that passes its target with a speed, or ends there at rest."""
    return TourLeg(
        from_id=from_id,
        to_id=to_id,
        t_dep_mjd2000=t_dep,
        tof_days=tof,
        m0_kg=m,
        m_final_kg=m - 10.0,
        m_star_kg=m,
        impulses=(_COAST,),
        dep_velocity_m_s=(0.0, launch, 0.0),
        arr_velocity_m_s=(speed, 0.0, 0.0),
        dropped_kg=dropped,
    )


def _flown(*legs, start=0):
    """Return a tour whose legs lead exactly where their records say."""
    stops = [start, *(leg.to_id for leg in legs if not leg.is_fly_by)]
    arrivals = tuple(
        Arrival(np.array([0.0, 0, 0, *leg.arr_velocity_m_s]), np.zeros(6)) for leg in legs
    )
    return FlownTour(tuple(map(_body, stops)), legs, arrivals)


def _failed(event, *legs, start=0):
    return {check.name for check in event.checks(_flown(*legs, start=start)) if not check.passed}


def test_all_kinds_are_events_with_the_same_checks_for_every_tour():
    assert sorted(event_kinds()) == ["drop", "fly-by", "groups", "launch"]
    events = [
        Launch(planet=PLANET, speed_max_m_s=1.0),
        FlyBy(speed_min_m_s=400.0),
        Drop(rendezvous_kg=1.0, fly_by_kg=1.0),
        Groups(ids=((1,), (2,)), start_counts=False),
    ]
    for event in events:
        assert isinstance(event, TourEvent)
        names = [check.name for check in event.checks(_flown())]
        assert names
        assert names == [check.name for check in event.checks(_flown(_leg(1), _leg(1, speed=5)))]
        assert make_event(msgspec.to_builtins(event)) == event


def test_what_a_tour_does_not_allow_is_found_by_the_forbidden_rule():
    plain = [_leg(1), _leg(2)]
    for kind, broken in (
        (Launch, [_leg(1, launch=3.0)]),
        (FlyBy, [_leg(1), _leg(1, speed=5.0)]),
        (Drop, [_leg(1, dropped=1.0)]),
    ):
        assert _failed(kind.forbidden(), *plain) == set()
        assert _failed(kind.forbidden(), *broken)
    assert Groups.forbidden() is None


# Launch


@given(st.floats(0.0, 1e4), st.floats(0.0, 1e4))
def test_a_launch_may_be_as_fast_as_the_rule_says(speed, most):
    failed = _failed(Launch(planet=None, speed_max_m_s=most), _leg(1, launch=speed))
    assert ("launch speed" in failed) == (speed > most + 1e-6)


@pytest.mark.parametrize("name", ["id", "epoch_mjd2000", "a_m", "e", "i_rad", "mean_anomaly_rad"])
def test_a_launch_from_another_planet_is_found(name):
    moved = msgspec.structs.replace(PLANET, **{name: getattr(PLANET, name) * 1.001 + 1})
    rule = Launch(planet=moved, speed_max_m_s=1.0)
    assert _failed(rule, _leg(1)) == {"launch from the planet of the problem statement"}
    assert _failed(msgspec.structs.replace(rule, planet=_body(0)), _leg(1)) == set()


# Fly-bys

ONCE = "fly-bys of bodies met before, once each"


@pytest.mark.parametrize(
    ("legs", "failed"),
    [
        ([], set()),
        ([_leg(1), _leg(1, t_dep=8010.0, speed=401.0)], set()),
        ([_leg(1, speed=401.0)], {ONCE}),
        ([_leg(1), _leg(1, speed=401.0), _leg(1, t_dep=8010.0, speed=401.0)], {ONCE}),
        ([_leg(1), _leg(1, speed=399.0)], {"speed of fly-bys"}),
        ([_leg(1), _leg(1, speed=401.0), _leg(2, t_dep=8010.0)], set()),
        ([_leg(1), _leg(1, speed=401.0), _leg(2, t_dep=8010.1)], {"no stay after a fly-by"}),
    ],
)
def test_fly_bys_follow_a_rendezvous_once_fast_and_without_a_stay(legs, failed):
    assert _failed(FlyBy(speed_min_m_s=400.0), *legs) == failed


@given(st.lists(st.tuples(st.integers(1, 3), st.booleans()), max_size=8), st.integers(0, 2))
def test_no_body_is_passed_more_often_than_the_rule_says(visits, times):
    legs = [
        _leg(body, t_dep=8000.0 + 10.0 * k, speed=5.0 if passing else 0.0)
        for k, (body, passing) in enumerate(visits)
    ]
    good = all(
        not passing
        or (
            (body, False) in visits[:k]
            and sum(before == (body, True) for before in visits[:k]) < times
        )
        for k, (body, passing) in enumerate(visits)
    )
    assert (ONCE in _failed(FlyBy(speed_min_m_s=1.0, times=times), *legs)) == (not good)


VISITS = FlyBy(speed_min_m_s=0.0, times=0, visit_max_m_s=3000.0, last_max_m_s=0.0)
ANY = FlyBy(speed_min_m_s=0.0, times=0, visit_max_m_s=None)
LAST = FlyBy(speed_min_m_s=0.0, times=0, last_max_m_s=6000.0)


@pytest.mark.parametrize(
    ("rule", "legs", "failed"),
    [
        (VISITS, [(1, 2999.0), (2, 10.0), (3, 0.0)], set()),
        (VISITS, [(1, 3001.0), (2, 0.0)], {"speed of visits"}),
        (VISITS, [(1, 100.0), (2, 100.0)], {"fly-bys"}),
        (VISITS, [(1, 100.0), (1, 100.0), (2, 0.0)], {"fly-bys"}),
        (ANY, [(1, 1e5), (2, 0.0), (3, 1e5)], set()),
        (ANY, [(1, 1e5), (2, 1e5), (1, 1e5)], {"fly-bys"}),
        (LAST, [(1, 0.0), (2, 5999.0)], set()),
        (LAST, [(1, 0.0), (2, 6001.0)], {"speed at the last arrival"}),
        (LAST, [(1, 5.0), (2, 0.0)], {"fly-bys"}),
        (LAST, [(1, 0.0), (2, float("nan"))], {"speed at the last arrival"}),
    ],
)
def test_visits_may_be_as_fast_as_the_rule_says_and_each_body_is_passed_once(rule, legs, failed):
    flown = [
        _leg(body, t_dep=8000.0 + 10.0 * k, speed=speed) for k, (body, speed) in enumerate(legs)
    ]
    assert _failed(rule, *flown) - {"speed of fly-bys"} == failed
    assert make_event(msgspec.json.decode(msgspec.json.encode(rule))) == rule


def test_rules_from_before_fly_bys_as_visits_are_written_as_they_were():
    rule = FlyBy(speed_min_m_s=400.0)
    assert msgspec.to_builtins(rule) == {"kind": "fly-by", "speed_min_m_s": 400.0, "times": 1}


def test_a_fly_by_whose_speed_is_unknown_is_not_passed():
    legs = (_leg(1), _leg(1, speed=500.0, t_dep=8010.0))
    nothing = Arrival(np.full(6, np.nan), np.zeros(6))
    flown = FlownTour((_body(0), _body(1)), legs, (nothing, nothing))
    failed = {c.name for c in FlyBy(speed_min_m_s=400.0).checks(flown) if not c.passed}
    assert "speed of fly-bys" in failed


# Drops


@given(st.lists(st.tuples(st.booleans(), st.sampled_from([0.0, 1.0, 40.0])), max_size=6))
def test_each_rendezvous_and_fly_by_leaves_its_own_mass(stops):
    legs = [_leg(1, speed=5.0 if passing else 0.0, dropped=kg) for passing, kg in stops]
    good = all(kg == (1.0 if passing else 40.0) for passing, kg in stops)
    rule = Drop(rendezvous_kg=40.0, fly_by_kg=1.0)
    assert _failed(rule, *legs) == (set() if good else {"masses left behind"})


# Groups


@given(st.lists(st.integers(1, 9), max_size=5), st.booleans())
def test_a_tour_has_at_most_one_body_of_each_group_and_none_of_no_group(visited, start_counts):
    rule = Groups(ids=((1, 2), (3, 4, 5), (6,)), start_counts=start_counts)
    start = 6 if start_counts else 0
    groups = {1: 1, 2: 1, 3: 2, 4: 2, 5: 2, 6: 3}
    seen = [groups.get(body, 0) for body in ([6] if start_counts else []) + visited]
    good = 0 not in seen and len(set(seen)) == len(seen)
    failed = _failed(rule, *map(_leg, visited), start=start)
    assert failed == (set() if good else {"one body of each group"})


# Scores


def test_all_kinds_are_score_rules():
    assert sorted(score_kinds()) == ["mass-rate", "points", "visits"]
    for rule in (VisitCount(), Points(rendezvous=0.2, fly_by=0.8), MassRate(visits=4)):
        assert isinstance(rule, ScoreRule)
        assert make_score(msgspec.to_builtins(rule)) == rule
        assert rule.score((), ()) == 0.0


@given(st.integers(0, 20))
def test_visits_count_one_each(n):
    assert VisitCount().score(tuple(map(_body, range(n))), ()) == n


@given(st.lists(st.tuples(st.integers(1, 3), st.booleans()), max_size=8))
def test_points_are_for_the_first_rendezvous_and_the_first_fly_by_after_it(visits):
    legs = tuple(_leg(body, speed=5.0 if passing else 0.0) for body, passing in visits)
    expected = 0.0
    for body in (1, 2, 3):
        places = [k for k, visit in enumerate(visits) if visit == (body, False)]
        later = places and (body, True) in visits[places[0] :]
        weight = 1.5 if body == 1 else 1.0
        expected += weight * (0.2 * bool(places) + 0.8 * bool(later))
    rule = Points(rendezvous=0.2, fly_by=0.8, bonus_ids=(1,), bonus_factor=1.5)
    assert rule.score((), legs) == pytest.approx(expected)


@given(st.floats(100.0, 4000.0), st.floats(1.0, 5000.0), st.floats(0.0, 50.0))
def test_the_mass_rate_is_what_is_left_over_the_time_it_took(mass, days, dropped):
    legs = (_leg(1, tof=1.0), _leg(2, t_dep=8000.0 + days - 1.0, tof=1.0, m=mass, dropped=dropped))
    bodies = (_body(1), _body(2))
    rate = MassRate(visits=2).score(bodies, legs)
    assert rate == pytest.approx((mass - 10.0 - dropped) / (days / 365.25))
    assert MassRate(visits=3).score(bodies, legs) == 0.0


# Kinds in files


def _tour():
    rules = TourRules(
        name="toy",
        catalogue="nowhere",
        m0_kg=1000.0,
        m_dry_kg=500.0,
        thrust_n=0.3,
        isp_s=3000.0,
        first_departure_mjd2000=(8000.0, 8100.0),
        max_duration_days=100.0,
        min_stay_days=0.0,
        start_ids=(),
        events=(
            Launch(planet=PLANET, speed_max_m_s=1.0),
            FlyBy(speed_min_m_s=400.0, times=2),
            Drop(rendezvous_kg=1.0, fly_by_kg=0.5),
            Groups(ids=((1, 2), (3,)), start_counts=False),
        ),
        start_counts=False,
        score=MassRate(visits=1),
    )
    return Tour(
        rules=rules,
        t_start_mjd2000=8000.0,
        bodies=(PLANET, _body(1)),
        legs=(_leg(1),),
        score=1.0,
    )


def test_events_and_score_survive_the_tour_file(tmp_path):
    path = tmp_path / "sequence.json"
    path.write_text(to_json(_tour()))
    assert read_tour(path) == _tour()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"events": [{"kind": "sail"}]},
            "event of kind 'sail', known are drop, fly-by, groups, launch",
        ),
        (
            {"score": {"kind": "beauty"}},
            "score rule of kind 'beauty', known are mass-rate",
        ),
        ({"events": ["drop"]}, "event of kind '', known are drop"),
        ({"events": [{"kind": "drop"}]}, "event of kind 'drop': Object missing required field"),
        ({"score": {"kind": "visits", "each": 2}}, "score rule of kind 'visits': Object contains"),
    ],
)
def test_an_unknown_kind_is_named_in_one_line_with_the_file_and_those_that_are_known(
    tmp_path, change, words
):
    record = json.loads(to_json(_tour()))
    record["rules"] |= change
    path = tmp_path / "sequence.json"
    path.write_text(json.dumps(record))
    with pytest.raises(InputError) as caught:
        read_tour(path)
    assert str(caught.value).startswith(f"{path}: {words}")
    assert "\n" not in str(caught.value)
