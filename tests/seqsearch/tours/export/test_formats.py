"""Each format, read back by a program that is not ours."""

import csv
import json
from itertools import pairwise

import numpy as np
import pytest

from feasibility.constants import DAY_S, MJD2000_MJD
from feasibility.errors import InputError
from seqsearch.tours.export import Exporter, Flight, exporters, make_exporter
from seqsearch.tours.export.arcs import equatorial, mission_arcs
from seqsearch.tours.export.epochs import calendar, seconds_past_j2000
from seqsearch.tours.export.json_file import schema
from seqsearch.tours.export.spk import SPACECRAFT
from seqsearch.tours.paths import body_states, impulsive_trajectory
from tests.helpers.handmade_tours import handmade_tour

FORMATS = ("oem", "spk", "spk13", "stk", "csv", "json")


@pytest.fixture(scope="module")
def flight():
    tour = handmade_tour()
    return Flight(tour, impulsive_trajectory(tour))


def _finer(flight):
    """Return (n,) epochs between the rows of a flight and (n, 6) true states there, km."""
    fine = impulsive_trajectory(flight.tour, step_days=0.21)
    arcs = mission_arcs(Flight(flight.tour, fine))
    inside = [np.arange(1, len(arc) - 1) for arc in arcs]
    epochs = np.concatenate([arc.t_mjd2000[k] for arc, k in zip(arcs, inside, strict=True)])
    states = np.concatenate([arc.states[k] for arc, k in zip(arcs, inside, strict=True)])
    return epochs, equatorial(states) / 1e3


def test_all_formats_are_there_and_keep_the_contract():
    assert set(FORMATS) | {"rows"} <= set(exporters())
    assert all(isinstance(exporter, Exporter) for exporter in exporters().values())
    with pytest.raises(InputError, match=r"known are .*oem"):
        make_exporter("nope")


def test_arcs_cover_the_mission_without_a_gap_and_stays_are_at_the_body(flight):
    arcs = mission_arcs(flight)
    tour = flight.tour
    assert arcs[0].t_mjd2000[0] == tour.legs[0].t_dep_mjd2000
    assert arcs[-1].t_mjd2000[-1] == tour.legs[-1].t_arr_mjd2000
    for before, after in pairwise(arcs):
        assert after.t_mjd2000[0] == before.t_mjd2000[-1]
        assert np.linalg.norm(after.states[0, :3] - before.states[-1, :3]) < 1e3
    stays = [arc for arc in arcs if arc.stay]
    assert len(stays) == len(tour.legs) - 1
    for stay, body in zip(stays, tour.bodies[1:], strict=False):
        assert np.allclose(stay.states, body_states(body, stay.t_mjd2000, tour.rules.mu_m3_s2))
    assert all((np.diff(arc.t_mjd2000) > 0).all() for arc in arcs)


def test_epochs_have_calendar_texts_and_seconds():
    epochs = np.array([0.0, 0.5, 10957.25, 59.0 + 1e-6 / DAY_S])
    assert calendar(epochs) == [
        "2000-01-01T00:00:00.000000",
        "2000-01-01T12:00:00.000000",
        "2029-12-31T06:00:00.000000",
        "2000-02-29T00:00:00.000001",
    ]
    assert seconds_past_j2000(epochs)[:2].tolist() == [-43200.0, 0.0]


def test_oem_is_read_by_the_package_oem(flight, tmp_path):
    oem = pytest.importorskip("oem", reason="the package oem is not installed")
    path = tmp_path / "tour.oem"
    make_exporter("oem").write(flight, path)
    message = oem.OrbitEphemerisMessage.open(str(path))
    arcs = mission_arcs(flight)
    assert len(message.segments) == len(arcs)
    for segment, arc in zip(message.segments, arcs, strict=True):
        assert segment.metadata["CENTER_NAME"] == "SUN"
        assert segment.metadata["REF_FRAME"] == "EME2000"
        assert segment.metadata["TIME_SYSTEM"] == "TDB"
        rows = np.array([[*state.position, *state.velocity] for state in segment])
        assert np.abs(rows - equatorial(arc.states) / 1e3)[:, :3].max() < 1e-6
        assert np.abs(rows - equatorial(arc.states) / 1e3)[:, 3:].max() < 1e-12
    stop = message.segments[0].metadata["STOP_TIME"]
    assert abs(stop.mjd - (arcs[0].t_mjd2000[-1] + MJD2000_MJD)) < 2e-11
    assert "not refined" in path.read_text()
    assert max(map(len, path.read_text().splitlines())) <= 254


def test_oem_interpolates_to_metres(flight, tmp_path):
    oem = pytest.importorskip("oem", reason="the package oem is not installed")
    from astropy.time import Time

    path = tmp_path / "tour.oem"
    make_exporter("oem").write(flight, path)
    message = oem.OrbitEphemerisMessage.open(str(path))
    epochs, truth = _finer(flight)
    for k in range(5, len(epochs), 97):
        found = message(Time(epochs[k] + MJD2000_MJD, format="mjd", scale="tdb"))
        assert np.abs(found.position - truth[k, :3]).max() < 0.05


@pytest.mark.parametrize(("kind", "tolerance_km"), [("spk", 0.32), ("spk13", 5e-3)])
def test_kernels_are_read_by_spice(flight, tmp_path, kind, tolerance_km):
    spice = pytest.importorskip("spiceypy", reason="spiceypy is not installed")
    path = tmp_path / "tour.bsp"
    make_exporter(kind).write(flight, path)
    epochs, truth = _finer(flight)
    spice.kclear()
    spice.furnsh(str(path))
    try:
        et = seconds_past_j2000(epochs)
        found = np.array([spice.spkez(SPACECRAFT, t, "J2000", "NONE", 10)[0] for t in et])
        ecliptic = np.array(spice.spkez(SPACECRAFT, et[7], "ECLIPJ2000", "NONE", 10)[0])
        window = spice.spkcov(str(path), SPACECRAFT)
        cover = [spice.wnfetd(window, 0), spice.wncard(window)]
    finally:
        spice.kclear()
    assert np.linalg.norm(found - truth, axis=1).max() < tolerance_km
    assert np.abs(equatorial(ecliptic[None])[0] - found[7]).max() < 1e-4
    # One interval from the first departure to the last arrival: no gap at stays or impulses.
    legs = flight.tour.legs
    ends = seconds_past_j2000(np.array([legs[0].t_dep_mjd2000, legs[-1].t_arr_mjd2000]))
    assert cover[1] == 1
    assert np.allclose(cover[0], ends, atol=1e-3)


def test_kernels_are_read_by_jplephem(flight, tmp_path):
    jplephem = pytest.importorskip("jplephem.spk", reason="jplephem is not installed")
    path = tmp_path / "tour.bsp"
    make_exporter("spk").write(flight, path)
    epochs, truth = _finer(flight)
    with jplephem.SPK.open(str(path)) as kernel:
        # A copy: the arrays of an open kernel are mapped memory.
        found = np.array(kernel[10, SPACECRAFT].compute(epochs + 2451544.5))
        comments = kernel.comments()
    assert np.linalg.norm(found.T - truth[:, :3], axis=1).max() < 1.0
    assert "not refined" in comments


def test_rows_themselves_are_in_kernels(flight, tmp_path):
    spice = pytest.importorskip("spiceypy", reason="spiceypy is not installed")
    path = tmp_path / "tour.bsp"
    make_exporter("spk13").write(flight, path)
    spice.furnsh(str(path))
    try:
        for arc in mission_arcs(flight)[::7]:
            et = float(seconds_past_j2000(arc.t_mjd2000[1:2])[0])
            found = spice.spkez(SPACECRAFT, et, "J2000", "NONE", 10)[0]
            assert np.abs(found - equatorial(arc.states)[1] / 1e3).max() < 1e-6
    finally:
        spice.kclear()


def test_stk_has_a_boundary_for_each_arc(flight, tmp_path):
    path = tmp_path / "tour.e"
    make_exporter("stk").write(flight, path)
    lines = path.read_text().splitlines()
    arcs = mission_arcs(flight)
    assert lines[0] == "stk.v.11.0"
    assert lines[-1] == "END Ephemeris"
    begin = lines.index("BEGIN SegmentBoundaryTimes")
    end = lines.index("END SegmentBoundaryTimes")
    assert end - begin - 1 == len(arcs) - 1
    start = lines.index("EphemerisTimePosVel")
    rows = np.array(
        [
            [float(x) for x in line.split()]
            for line in lines[start + 1 : -1]
            if line and line[0] != "#"
        ]
    )
    assert f"NumberOfEphemerisPoints {len(rows)}" in lines
    assert "ScenarioEpoch 26 Nov 2021 00:00:00.000000" in lines
    assert rows.shape == (sum(map(len, arcs)), 7)
    assert (np.diff(rows[:, 0]) >= 0).all()
    # The first departure is at 06:00 TDB.
    assert rows[0, 0] == pytest.approx(6 * 3600 - 69.184, abs=1e-6)
    assert np.abs(rows[0, 1:] - equatorial(arcs[0].states)[0] / 1e3).max() < 1e-6


def test_csv_has_all_rows(flight, tmp_path):
    path = tmp_path / "tour.csv"
    make_exporter("csv").write(flight, path)
    rows = list(csv.DictReader(path.open(encoding="utf-8")))
    arcs = mission_arcs(flight)
    assert len(rows) == sum(map(len, arcs))
    assert {row["model"] for row in rows} == {"impulsive"}
    assert {row["kind"] for row in rows} == {"flight", "stay"}
    assert [float(rows[0][name]) for name in ("t_mjd_tdb", "m_kg")] == [59544.25, 2000.0]
    assert float(rows[-1]["x_km"]) == arcs[-1].states[-1, 0] / 1e3


def test_json_keeps_its_schema_and_its_numbers(flight, tmp_path):
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    path = tmp_path / "tour.json"
    make_exporter("json").write(flight, path)
    document = json.loads(path.read_text())
    jsonschema.Draft202012Validator.check_schema(schema())
    validator = jsonschema.Draft202012Validator(schema())
    validator.validate(document)
    first = mission_arcs(flight)[0]
    assert document["arcs"][0]["rows"][0][1:4] == (first.states[0, :3] / 1e3).tolist()
    assert document["model"] == "impulsive"
    del document["arcs"][0]["rows"][0][0]
    assert not validator.is_valid(document)


@pytest.mark.parametrize("kind", FORMATS)
def test_names_of_strangers_do_no_harm(tmp_path, kind):
    names = ("<script>alert(1)</script>", 'a,"b"\nMETA_STOP', "Čapek \x00\x07", "")
    tour = handmade_tour(names=names, problem="x\ny é")
    path = tmp_path / "tour.x"
    make_exporter(kind).write(Flight(tour, impulsive_trajectory(tour)), path)
    assert path.stat().st_size > 0


@pytest.mark.parametrize("kind", FORMATS)
def test_a_file_is_written_whole_or_not_at_all(flight, tmp_path, kind):
    with pytest.raises(InputError, match=r"tour\.x: cannot be written"):
        make_exporter(kind).write(flight, tmp_path / "nowhere" / "tour.x")
    path = tmp_path / "tour.x"
    path.write_text("old")
    make_exporter(kind).write(flight, path)
    assert path.read_bytes()[:3] != b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_path_may_be_longer_than_spice_takes_it(flight, tmp_path):
    jplephem = pytest.importorskip("jplephem.spk", reason="jplephem is not installed")
    deep = tmp_path
    for _ in range(6):
        deep /= "a rather long name of a folder, as some people have them"
    deep.mkdir(parents=True)
    make_exporter("spk13").write(flight, deep / "tour.bsp")
    with jplephem.SPK.open(str(deep / "tour.bsp")) as kernel:
        assert len(kernel.segments) == len(mission_arcs(flight))
    assert list(deep.iterdir()) == [deep / "tour.bsp"]


def test_rows_want_thrust(flight, tmp_path):
    with pytest.raises(InputError, match="refine"):
        make_exporter("rows").write(flight, tmp_path / "tour.rows")
    assert not (tmp_path / "tour.rows").exists()
