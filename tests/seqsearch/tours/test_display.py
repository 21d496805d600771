"""Tours as people meet them: short texts, tables with dates, records for pandas."""

import importlib.util

import numpy as np
import pytest

from feasibility import MissingDependencyError
from seqsearch import plot_tour, search
from seqsearch.tours.dates import date_of
from seqsearch.tours.display import rows
from tests.helpers.problems import small_problem, small_settings


@pytest.fixture(scope="module")
def result():
    return search(small_problem(), settings=small_settings(), rng=np.random.default_rng(4))


def test_reprs_are_one_line_that_says_what_was_found(result):
    for text in (repr(result), repr(result.tour)):
        assert len(text) < 200
        assert f"{result.tour.n_asteroids} asteroids" in text
        assert "\n" not in text


def test_tables_name_bodies_and_dates(result):
    tour = result.tour
    html = result._repr_html_()
    for leg in tour.legs:
        for word in (tour.body(leg.to_id).name, date_of(leg.t_dep_mjd2000)):
            assert word in tour.table()
            assert word in html
    assert html.count("<tr>") == 1 + len(tour.legs)


def test_records_have_one_row_a_leg(result):
    found = rows(result.tour)
    assert [row["to_id"] for row in found] == [body.id for body in result.tour.bodies[1:]]
    assert sum(row["tof_days"] for row in found) <= result.tour.duration_days
    if importlib.util.find_spec("pandas") is None:
        with pytest.raises(MissingDependencyError, match="pandas"):
            result.tour.to_dataframe()
    else:
        frame = result.tour.to_dataframe()
        assert list(frame["leg"]) == list(range(1, len(found) + 1))


def test_the_picture_is_drawn_from_python(result, tmp_path):
    plot_tour(result.tour, tmp_path / "tour.svg")
    assert "<svg" in (tmp_path / "tour.svg").read_text()
