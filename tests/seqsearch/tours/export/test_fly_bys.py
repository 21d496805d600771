"""Tours that launch from a planet, pass bodies and leave masses behind, as files."""

import csv
from itertools import pairwise

import numpy as np
import pytest

from seqsearch import SearchSettings, search
from seqsearch.report.drawings import drawings
from seqsearch.report.material import gather
from seqsearch.report.page import render
from seqsearch.tours.export import Flight, make_exporter
from seqsearch.tours.export.arcs import mission_arcs
from seqsearch.tours.export.epochs import seconds_past_j2000
from seqsearch.tours.export.spk import SPACECRAFT
from seqsearch.tours.paths import impulsive_trajectory
from seqsearch.tours.pictures.plots import plot_tour
from seqsearch.tours.tour_files import to_json
from tests.helpers.gtoc5 import toy_problem


@pytest.fixture(scope="module")
def tour():
    settings = SearchSettings().with_(
        beam_width=2, start_epochs=2, neighbours=30, pruner="default:0.99", audit={"per_rank": 0}
    )
    found = search(toy_problem(), settings=settings, rng=np.random.default_rng(2), max_solves=200)
    assert any(leg.is_fly_by for leg in found.tour.legs)
    return found.tour


@pytest.fixture(scope="module")
def flight(tour):
    return Flight(tour, impulsive_trajectory(tour))


def test_the_way_has_no_gap_and_no_stay_after_a_fly_by(tour, flight):
    arcs = mission_arcs(flight)
    for before, after in pairwise(arcs):
        assert after.t_mjd2000[0] == before.t_mjd2000[-1]
        assert np.linalg.norm(after.states[0, :3] - before.states[-1, :3]) < 1e6
    stays = {arc.number for arc in arcs if arc.stay}
    assert not stays & {k for k, leg in enumerate(tour.legs, 1) if leg.is_fly_by}
    assert flight.trajectory.phases[0].start == "EARTH"


def test_a_kernel_covers_it_all(tour, flight, tmp_path):
    spice = pytest.importorskip("spiceypy", reason="spiceypy is not installed")
    path = tmp_path / "tour.bsp"
    for kind in ("spk", "spk13"):
        make_exporter(kind).write(flight, path)
        window = spice.spkcov(str(path), SPACECRAFT)
        assert spice.wncard(window) == 1
        ends = np.array([tour.legs[0].t_dep_mjd2000, tour.legs[-1].t_arr_mjd2000])
        assert np.allclose(spice.wnfetd(window, 0), seconds_past_j2000(ends), atol=2e-3)


def test_masses_left_behind_show(tour, flight, tmp_path):
    make_exporter("csv").write(flight, tmp_path / "tour.csv")
    rows = list(csv.DictReader((tmp_path / "tour.csv").open()))
    masses = [float(row["m_kg"]) for row in rows]
    assert masses == sorted(masses, reverse=True)
    dropped = sum(leg.dropped_kg for leg in tour.legs[:-1])
    assert dropped > 0
    (tmp_path / "sequence.json").write_text(to_json(tour))
    line = drawings(gather(tmp_path / "sequence.json"))["mass"]
    assert line[-1][1] == pytest.approx(tour.m_final_kg, abs=1e-3)


def test_page_and_picture_have_them(tour, tmp_path):
    (tmp_path / "sequence.json").write_text(to_json(tour))
    assert "fly-by" in render(gather(tmp_path / "sequence.json"))
    plot_tour(tour, tmp_path / "tour.svg")
    assert (tmp_path / "tour.svg").stat().st_size > 10_000
