import json
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from feasibility import InputError
from feasibility.constants import DAY_S, G0
from seqsearch.tours.carrier.carrier_files import CARRIER, read_carrier, write_carrier
from seqsearch.tours.carrier.path import fly_carrier
from seqsearch.tours.carrier.reading import read_carrier_files
from seqsearch.tours.carrier.records import (
    Carrier,
    CarrierImpulse,
    CarrierLaunch,
    CraftCapture,
    CraftRelease,
)
from seqsearch.tours.carrier.rows import docked_carrier, write_carrier_rows
from seqsearch.tours.motion import body_state, coast
from seqsearch.tours.trajectory import Trajectory
from tests.helpers.carriers import T_LAUNCH, small_mission, small_rules

LAUNCH = CarrierLaunch(t_mjd2000=T_LAUNCH, v_inf_m_s=(100.0, 0.0, 0.0))


def _carrier(*events):
    return Carrier(rules=small_rules(), events=events)


def test_masses_follow_the_rocket_equation_releases_and_captures():
    carrier, *_ = small_mission()
    path = fly_carrier(carrier)
    first = 9000.0 * np.exp(-np.hypot(200.0, 100.0) / (900.0 * G0))
    assert path.mass_kg[:3] == pytest.approx([9000.0, first, first - 2000.0], rel=1e-14)
    assert path.alone_kg[:3] == pytest.approx([5000.0, first - 4000.0, first - 4000.0], rel=1e-14)
    assert path.mass_kg[-1] == pytest.approx(path.alone_kg[-1] + 2 * 1950.0)
    assert path.propellant_left_kg == pytest.approx(path.alone_kg[-1] - 2000.0)


def test_states_agree_with_an_integration():
    carrier, *_ = small_mission()
    path = fly_carrier(carrier)
    for k, (before, after) in enumerate(pairwise(path.t_mjd2000)):
        flown = path.after[k]
        if after > before:
            flown = coast(flown, (after - before) * DAY_S, carrier.rules.mu_m3_s2)
        assert flown == pytest.approx(path.before[k + 1], rel=1e-9)


def test_states_at_any_epoch_come_after_the_events_of_that_epoch():
    carrier, *_ = small_mission()
    path = fly_carrier(carrier)
    assert path.states([8030.5]) == pytest.approx(path.after[[4]])
    assert path.states(8000.0).shape == (1, 6)
    with pytest.raises(InputError, match="before the launch"):
        path.states([8005.0, 7999.0])


def test_orbits_of_releases_and_captures_are_those_of_that_event():
    carrier, *_ = small_mission()
    path = fly_carrier(carrier)
    mu = carrier.rules.mu_m3_s2
    released = path.release_orbit(2, body_id=-2)
    assert body_state(released, 8030.5, mu) == pytest.approx(path.after[3], rel=1e-9)
    assert body_state(path.orbit(8030.5, body_id=-2), 8030.5, mu) == pytest.approx(
        path.after[4], rel=1e-9
    )
    caught = path.capture_orbit(1, body_id=-3, name="HOME")
    assert (caught.id, caught.name) == (-3, "HOME")
    assert body_state(caught, 8190.0, mu) == pytest.approx(path.after[6], rel=1e-9)
    with pytest.raises(InputError, match="no CraftRelease of craft 3"):
        path.release_orbit(3, body_id=-2)


@pytest.mark.parametrize(
    ("events", "says"),
    [
        ((), "one launch, as the first event"),
        ((CraftRelease(t_mjd2000=8001.0, craft=1),), "one launch"),
        ((LAUNCH, LAUNCH), "one launch"),
        ((LAUNCH, CraftRelease(t_mjd2000=8001.0, craft=3)), "release of craft 3"),
        (
            (LAUNCH, *[CraftRelease(t_mjd2000=8001.0, craft=1)] * 2),
            "event 3: release of craft 1",
        ),
        ((LAUNCH, CraftCapture(t_mjd2000=8001.0, craft=1, mass_kg=9.0)), "capture of craft 1"),
        ((LAUNCH, CarrierImpulse(t_mjd2000=7999.0, dv_m_s=(0.0, 0.0, 1.0))), "in order of time"),
        (
            (LAUNCH, CarrierImpulse(t_mjd2000=8001.0, dv_m_s=(0.0, float("nan"), 1.0))),
            "event 2: a number that is not finite",
        ),
    ],
)
def test_flights_that_make_no_sense_are_refused(events, says):
    with pytest.raises(InputError, match=says):
        _carrier(*events)


def test_events_are_added_in_order_of_time_after_those_of_the_same_epoch():
    one = CraftRelease(t_mjd2000=8010.0, craft=1)
    burn = CarrierImpulse(t_mjd2000=8010.0, dv_m_s=(0.0, 0.0, 1.0))
    home = CraftCapture(t_mjd2000=8020.0, craft=1, mass_kg=1900.0)
    carrier = _carrier(LAUNCH, one)
    carrier = carrier.with_events(home, burn)
    assert carrier.events == (LAUNCH, one, burn, home)
    assert carrier.impulses == (burn,)
    assert (carrier.release(1), carrier.capture(1)) == (one, home)
    assert (carrier.release(2), carrier.capture(2)) == (None, None)


def test_a_file_is_read_back_exactly(tmp_path):
    carrier, *_ = small_mission()
    write_carrier(carrier, tmp_path / CARRIER)
    assert read_carrier(tmp_path / CARRIER) == carrier


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda record: record.update(format="seqsearch-carrier-9"), "'seqsearch-carrier-9'"),
        (lambda record: record.pop("rules"), "not a complete seqsearch-carrier-1 file"),
        (lambda record: record.update(more=1), "not a complete"),
        (lambda record: record["events"].reverse(), "one launch, as the first event"),
        (lambda record: record["events"][0].update(kind="jump"), "not a complete"),
    ],
)
def test_damaged_files_are_named(tmp_path, change, says):
    carrier, *_ = small_mission()
    file = tmp_path / CARRIER
    write_carrier(carrier, file)
    record = json.loads(file.read_text())
    change(record)
    file.write_text(json.dumps(record))
    with pytest.raises(InputError, match=says) as caught:
        read_carrier(file)
    assert str(file) in str(caught.value)
    with pytest.raises(InputError, match="cannot be read"):
        read_carrier(tmp_path / "absent.json")


def test_files_have_the_numbers_of_the_flight(tmp_path):
    carrier, craft, _ = small_mission()
    docked = write_carrier_rows(tmp_path, carrier, craft)
    path, files = fly_carrier(docked), read_carrier_files(tmp_path)
    assert [str(row) for row in files.log] == [
        "LAUNCH", "DV", "RELEASE P1", "RELEASE P2", "DV", "DV", "CAPTURE P1", "CAPTURE P2",
    ]  # fmt: skip
    for k, row in enumerate(files.log):
        assert row.state == pytest.approx(path.after[k], rel=1e-15)
        assert row.mass_kg == path.mass_kg[k]
        assert row.t_mjd2000 == pytest.approx(path.t_mjd2000[k], abs=1e-10)
    for number, phases in files.craft.items():
        assert [(phase.start, phase.end) for phase in phases] == [
            ("MOTHER", f"10{number}"),
            (f"10{number}", "MOTHER"),
        ]
        for phase, own in zip(phases, craft[number].phases, strict=True):
            assert phase.states == pytest.approx(own.states, rel=1e-12)
            assert phase.thrust_n == pytest.approx(own.thrust_n, rel=1e-12)


def test_releases_and_captures_go_where_the_rows_of_the_craft_have_them():
    carrier, craft, _ = small_mission()
    docked = docked_carrier(carrier, craft)
    for number in (1, 2):
        last = craft[number].phases[-1]
        assert docked.capture(number).mass_kg == last.mass_kg[-1]
        assert docked.capture(number).t_mjd2000 == last.t_mjd2000[-1]
    with pytest.raises(InputError, match=r"releases craft \[1, 2\], expected those that have"):
        docked_carrier(carrier, {1: craft[1]})


def test_impulses_of_craft_are_not_handed_in(tmp_path):
    carrier, craft, _ = small_mission()
    jumps = Trajectory(craft[1].phases, continuous=False)
    with pytest.raises(InputError, match="P1: impulses, expected continuous thrust"):
        write_carrier_rows(tmp_path, carrier, {1: jumps, 2: craft[2]})


def test_rules_are_plain_data():
    rules = small_rules()
    again = msgspec.json.decode(msgspec.json.encode(rules), type=type(rules))
    assert again == rules
