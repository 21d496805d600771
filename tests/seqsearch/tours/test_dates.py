"""Dates: epochs as people write them, and units that were meant but not said."""

import datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility import InputError
from feasibility.constants import MJD2000_MJD
from seqsearch.problems.problem_file import read_config
from seqsearch.tours.dates import date_of, mjd_of
from tests.helpers.problem_texts import GOOD


@given(st.dates(datetime.date(1950, 1, 1), datetime.date(2300, 1, 1)))
def test_dates_survive_a_round_trip(date):
    mjd = mjd_of(date, "epoch")
    assert date_of(mjd - MJD2000_MJD) == date.isoformat()
    assert mjd_of(date.isoformat(), "epoch") == mjd
    noon = datetime.datetime.combine(date, datetime.time(12))
    assert mjd_of(noon, "epoch") == mjd + 0.5


def test_known_dates():
    assert mjd_of("2000-01-01", "epoch") == MJD2000_MJD
    assert mjd_of("2030-01-01T06:00", "epoch") == 62502.25
    assert date_of(0.0) == "2000-01-01"


@pytest.mark.parametrize(
    ("value", "hint"),
    [
        (2462502.5, "Julian date.*62502"),
        (10958, "MJD2000.*62502"),
        (2030, "year.*62502"),
        (1e9, "expected 33282"),
        (float("nan"), "no MJD"),
        ("soon", "a date such as"),
        (True, "a date such as"),
        ([1], "a date such as"),
    ],
)
def test_another_unit_is_refused_with_what_was_probably_meant(value, hint):
    with pytest.raises(InputError, match=f"key: .*{hint}"):
        mjd_of(value, "key")


def test_a_problem_file_may_have_dates(tmp_path):
    path = tmp_path / "mine.toml"
    for window in ('["2021-01-01", "2023-02-25"]', "[2021-01-01, 2023-02-25T00:00:00]"):
        path.write_text(GOOD.replace("[59215, 60000]", window))
        assert read_config(str(path)).mission.first_departure_mjd == (59215.0, 60000.0)
    path.write_text(GOOD.replace("[59215, 60000]", "[2459215.5, 2460000.5]"))
    with pytest.raises(InputError, match=r"first_departure_mjd: .*Julian date\? then MJD 59215"):
        read_config(str(path))
