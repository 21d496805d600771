"""SPK kernels: states as SPICE has them, coverage that is checked, one line where they are bad."""

import pickle
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import spiceypy

from feasibility import InputError
from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.orbits import read_catalogue
from feasibility.orbits.spk.kepler_error import ERROR_KM, ERROR_M_S, motion_line
from feasibility.orbits.spk.reading import read_kernels
from tests.helpers.kernels import belt, kepler_states, seconds, write_kernel

START, END = 11000.0, 12500.0
WINDOW = (11200.0, 12300.0)
FIRST = 2_000_101
"""NAIF number of the first body."""

REAL = Path(__file__).resolve().parents[3] / "shared" / "real"


@pytest.fixture
def kernel(tmp_path):
    """Return a kernel with three bodies that are pushed off their ellipses."""
    file = tmp_path / "three.bsp"
    for row in range(3):
        write_kernel(file, FIRST + row, kepler_states(row, 2e8), START, END)
    return file


def truth(files, body, t_mjd2000):
    """Return (k, 6) heliocentric states, m and m/s, by SPICE's own search through kernels."""
    loaded = [str(file) for file in files]
    for file in loaded:
        spiceypy.furnsh(file)
    try:
        states = [spiceypy.spkgeo(body, t, "ECLIPJ2000", 10)[0] for t in seconds(t_mjd2000)]
    finally:
        for file in reversed(loaded):
            spiceypy.unload(file)
    return 1e3 * np.array(states)


def off(found, expected):
    """Return the largest errors in position and velocity."""
    error = found - expected
    return (
        np.linalg.norm(error[:, :3], axis=1).max(),
        np.linalg.norm(error[:, 3:], axis=1).max(),
    )


def check_table(path, files, window, bodies=(), n=400):
    """Check a table against SPICE, all through the window, and return the catalogue."""
    catalogue = read_kernels(path, bodies, "spk", window)
    epochs = np.random.default_rng(8).uniform(*window, n)
    epochs[:2] = window
    for row, body in enumerate(catalogue.ids):
        states = catalogue.states_at(np.full(n, row), epochs)
        position, velocity = off(states, truth(files, int(body), epochs))
        assert position < 1.0, catalogue.names[row]
        assert velocity < 1e-3
    return catalogue


def one_line(path, match, *arguments):
    with pytest.raises(InputError, match=match) as error:
        read_kernels(path, *arguments)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("kind", [9, 13])
@pytest.mark.parametrize("frame", ["J2000", "ECLIPJ2000"])
def test_bodies_move_as_spice_has_them(tmp_path, kind, frame):
    file = tmp_path / "one.bsp"
    write_kernel(file, FIRST, kepler_states(0, 2e8), START, END, kind=kind, frame=frame)
    catalogue = check_table(file, [file], WINDOW)
    assert catalogue.ids.tolist() == [FIRST]
    epochs = np.linspace(*WINDOW, 50)
    motion = kepler_states(0, 2e8)(epochs)
    assert off(catalogue.states_at(np.zeros(50, dtype=int), epochs), motion)[0] < 1e4


def test_a_body_relative_to_the_barycentre_needs_the_sun(tmp_path):
    def sun(t):
        circle = np.column_stack([np.cos(t / 700), np.sin(t / 700), 0 * t]) * 7e8
        speed = np.column_stack([-np.sin(t / 700), np.cos(t / 700), 0 * t]) * 7e8 / 700 / DAY_S
        return np.hstack([circle, speed])

    folder = tmp_path / "kernels"
    folder.mkdir()
    about = kepler_states(0)
    write_kernel(folder / "body.bsp", FIRST, lambda t: about(t) + sun(t), START, END, centre=0)
    said = one_line(folder, "the Sun", (), "spk", WINDOW)
    assert "de440s.bsp" in said
    assert str(FIRST) in said
    write_kernel(folder / "sun.bsp", 10, sun, START, END, centre=0)
    catalogue = check_table(folder, [folder / "body.bsp", folder / "sun.bsp"], WINDOW)
    epochs = np.linspace(*WINDOW, 50)
    states = catalogue.states_at(np.zeros(50, dtype=int), epochs)
    assert off(states, about(epochs))[0] < 1e4
    assert [source.name for source in catalogue.ephemeris.sources] == ["body.bsp", "sun.bsp"]


def test_a_moon_of_a_body_is_followed_through_its_centre(tmp_path):
    file = tmp_path / "both.bsp"
    write_kernel(file, FIRST, kepler_states(0), START, END)
    write_kernel(
        file, -77, lambda t: np.full((len(t), 6), [3e5, 2e5, 1e5, 0, 0, 0]), START, END,
        centre=FIRST,
    )  # fmt: skip
    catalogue = check_table(file, [file], WINDOW)
    assert catalogue.ids.tolist() == [-77, FIRST]
    alone = tmp_path / "alone.bsp"
    write_kernel(alone, -77, kepler_states(0), START, END, centre=FIRST)
    assert str(FIRST) in one_line(alone, "relative to body")


def test_elements_osculate_in_the_middle_of_the_window(kernel):
    catalogue = read_kernels(kernel, window_mjd2000=WINDOW)
    middle = sum(WINDOW) / 2
    assert catalogue.ephemeris is None
    assert catalogue.epoch_mjd2000 == pytest.approx(middle)
    states = catalogue.states(middle)
    for row in range(3):
        position, velocity = off(states[[row]], truth([kernel], FIRST + row, [middle]))
        assert position < 1.0
        assert velocity < 1e-6


def test_without_a_mission_elements_osculate_in_the_middle_of_the_coverage(kernel):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        catalogue = read_catalogue(kernel, select=f"id < {FIRST + 2}")
    assert catalogue.ids.tolist() == [FIRST, FIRST + 1]
    assert catalogue.epoch_mjd2000 == pytest.approx((START + END) / 2)
    assert catalogue.extra["covered_from_mjd"] == pytest.approx(START + 51544)
    assert catalogue.extra["covered_to_mjd"] == pytest.approx(END + 51544)


def test_the_error_of_kepler_motion_is_the_largest_of_the_window(kernel):
    catalogue = read_kernels(kernel, window_mjd2000=WINDOW)
    epochs = np.linspace(*WINDOW, 2000)
    for row in range(3):
        moved = catalogue.states_at(np.full(2000, row), epochs)
        position, velocity = off(moved, truth([kernel], FIRST + row, epochs))
        assert catalogue.extra[ERROR_KM][row] == pytest.approx(position / 1e3, rel=1e-3)
        assert catalogue.extra[ERROR_M_S][row] == pytest.approx(velocity, rel=1e-3)
    worst = catalogue.extra[ERROR_KM].max()
    assert f"{worst:.3g} km ({worst * 1e3 / AU:.2g} AU)" in motion_line(catalogue)
    told = read_kernels(kernel, (), "spk", WINDOW)
    assert np.array_equal(told.extra[ERROR_KM], catalogue.extra[ERROR_KM])
    assert "as the kernels say" in motion_line(told)
    assert motion_line(belt()) is None


def test_catalogues_of_kernels_are_selected_and_sent_to_processes(kernel):
    catalogue = read_kernels(kernel, (), "spk", WINDOW)
    epochs = np.linspace(*WINDOW, 20)
    expected = catalogue.states_at(np.full(20, 2), epochs)
    some = catalogue.select([2, 0])
    assert np.array_equal(some.states_at(np.zeros(20, dtype=int), epochs), expected)
    copy = pickle.loads(pickle.dumps(some))
    assert np.array_equal(copy.states_at(np.zeros(20, dtype=int), epochs), expected)
    assert copy.ephemeris.digest == some.ephemeris.digest != catalogue.ephemeris.digest
    assert len(catalogue.select(np.zeros(3, dtype=bool)).ephemeris) == 0


def test_beyond_the_table_bodies_go_on_along_kepler_orbits(kernel):
    from feasibility.orbits.kepler_kernels import propagate_batch

    catalogue = read_kernels(kernel, (), "spk", (START, END))
    last = catalogue.states(END)
    ahead = propagate_batch(last, np.full(3, 20 * DAY_S), MU_SUN)
    assert np.allclose(catalogue.states(END + 20), ahead, rtol=1e-12)


def test_bodies_are_named_by_numbers_and_names(tmp_path):
    file = tmp_path / "named.bsp"
    for row, body in enumerate((2000001, 20000433, -79, 399, 4)):
        write_kernel(file, body, kepler_states(row), START, END)
    assert read_kernels(file).ids.tolist() == [-79, 2000001, 20000433]
    assert read_kernels(file).names == ("SIRTF", "CERES", "EROS")
    assert read_kernels(file, ["ceres", 433, "-79"]).ids.tolist() == [2000001, 20000433, -79]
    assert read_kernels(file, [399, 4]).ids.tolist() == [399, 4]
    said = one_line(file, "'vesta'", ["vesta"])
    assert "2000001 CERES" in said
    one_line(file, "twice", ["ceres", 2000001])
    planets = tmp_path / "planets.bsp"
    write_kernel(planets, 399, kepler_states(0), START, END)
    assert "bodies = [...]" in one_line(planets, "399 EARTH")


def test_a_window_outside_the_coverage_is_one_line(kernel):
    for ephemeris in ("spk", "kepler"):
        said = one_line(kernel, "is covered", (), ephemeris, (13000.0, 13500.0))
        for word in (str(kernel), str(FIRST), "2030-02-12 to 2034-03-23", "2035-08-05", "TDB"):
            assert word in said
    one_line(kernel, "is covered", (), "spk", (12000.0, END + 1))
    with pytest.warns(UserWarning, match="is covered"):
        catalogue = read_kernels(kernel, window_mjd2000=(12000.0, END + 1000))
    assert catalogue.epoch_mjd2000 == pytest.approx(END)


def test_a_gap_is_one_line_and_elements_keep_out_of_it(tmp_path):
    file = tmp_path / "gap.bsp"
    write_kernel(file, FIRST, kepler_states(0), 11000.0, 11600.0)
    write_kernel(file, FIRST, kepler_states(0), 11700.0, 12500.0)
    said = one_line(file, "with gaps", (), "spk", WINDOW)
    assert "and" in said
    check_table(file, [file], (11710.0, 12300.0))
    with pytest.warns(UserWarning, match="with gaps"):
        catalogue = read_kernels(file, window_mjd2000=(11500.0, 11780.0))
    assert catalogue.epoch_mjd2000 == pytest.approx(11600.0)


def test_of_two_kernels_the_later_one_counts(tmp_path):
    first, second = tmp_path / "a.bsp", tmp_path / "b.bsp"
    write_kernel(first, FIRST, kepler_states(0), START, END)
    write_kernel(second, FIRST, kepler_states(1), 11500.0, 12000.0)
    check_table(tmp_path, [first, second], WINDOW)


def _meta(tmp_path, text):
    file = tmp_path / "all.tm"
    file.write_text(f"KPL/MK\n\\begindata\n{text}\n\\begintext\nsome words\n")
    return file


LEAP_SECONDS = """KPL/LSK
\\begindata
DELTET/DELTA_T_A = 32.184
DELTET/K = 1.657D-3
DELTET/EB = 1.671D-2
DELTET/M = ( 6.239996D0 1.99096871D-7 )
DELTET/DELTA_AT = ( 36, @2015-JUL-1
                    37, @2017-JAN-1 )
\\begintext
"""


def test_a_meta_kernel_is_read_with_its_leap_seconds(tmp_path):
    folder = tmp_path / "data"
    folder.mkdir()
    for row, name in enumerate(("one.bsp", "two.bsp")):
        write_kernel(folder / name, FIRST + row, kepler_states(row), START, END)
    (folder / "leap.tls").write_text(LEAP_SECONDS)
    meta = _meta(
        tmp_path,
        "PATH_VALUES = ( 'da+' 'ta' )\nPATH_SYMBOLS = ( 'D' )\n"
        "KERNELS_TO_LOAD = ( '$D/one.bsp',\n '$D/leap.tls' )\nKERNELS_TO_LOAD += '$D/two.bsp'",
    )
    assert read_catalogue(meta).ids.tolist() == [FIRST, FIRST + 1]
    said = one_line(meta, "UTC", (), "spk", (13000.0, 13500.0))
    spiceypy.furnsh(str(folder / "leap.tls"))
    try:
        utc = spiceypy.et2utc(float(seconds(START)), "ISOC", 0)
    finally:
        spiceypy.unload(str(folder / "leap.tls"))
    assert utc.replace("T", " ") in said


def test_bad_meta_kernels_and_folders_are_one_line(tmp_path):
    assert "gone.bsp" in one_line(_meta(tmp_path, "KERNELS_TO_LOAD = ( 'gone.bsp' )"), "not there")
    one_line(_meta(tmp_path, "KERNELS_TO_LOAD = ( )"), "no SPK kernel")
    one_line(_meta(tmp_path, "PATH_SYMBOLS = 'A'\nKERNELS_TO_LOAD = 'x'"), "PATH_VALUES")
    (tmp_path / "leap.tls").write_text("KPL/LSK\n\\begindata\n\\begintext\n")
    write_kernel(tmp_path / "one.bsp", FIRST, kepler_states(0), START, END)
    one_line(tmp_path, "no leap seconds")
    empty = tmp_path / "empty"
    empty.mkdir()
    one_line(empty, "is a folder without SPK kernels")


def test_damaged_kernels_are_one_line(kernel):
    content = kernel.read_bytes()

    def refused(changed, match):
        kernel.write_bytes(changed)
        assert str(kernel) in one_line(kernel, match)

    refused(content[:500], "cut off")
    refused(content[: len(content) // 2], "cut off")
    refused(content[:8] + bytes(1016), "damaged")
    refused(b"DAF/CK  " + content[8:], "DAF/CK")
    refused(b"DAFETF NAIF DAF ENCODED TRANSFER FILE\n", "transfer")
    refused(content[:1024] + b"\xff" * 1024 + content[2048:], "damaged")
    # The states of a segment are no numbers.
    refused(content[:3072] + b"\xff" * (len(content) - 3072), "damaged")
    refused(content[:699] + b"FTPSTR:\n:\n\n:ENDFTP".ljust(28) + content[727:], "damaged")


def test_any_damage_is_one_line_or_harmless(kernel):
    content = kernel.read_bytes()
    rng = np.random.default_rng(2)
    for _ in range(60):
        changed = bytearray(content)
        # The file record and the summaries, where damage does most harm.
        for place in rng.integers(8, 3072, 4):
            changed[place] = rng.integers(256)
        kernel.write_bytes(bytes(changed))
        with warnings.catch_warnings(), suppress(InputError):
            warnings.simplefilter("ignore")
            read_kernels(kernel)


def test_states_in_a_turning_frame_are_refused(tmp_path):
    file = tmp_path / "fixed.bsp"
    write_kernel(file, FIRST, kepler_states(0), START, END, frame="IAU_EARTH")
    assert "inertial" in one_line(file, "IAU_EARTH")


def test_bodies_on_no_ellipse_are_left_out_and_counted(tmp_path):
    def fast(t):
        states = kepler_states(0)(t)
        states[:, 3:] *= 2.0
        return states

    file = tmp_path / "fast.bsp"
    write_kernel(file, FIRST, fast, START, END)
    one_line(file, "no ellipse")
    write_kernel(file, FIRST + 1, kepler_states(1), START, END)
    with pytest.warns(UserWarning, match=f"1 of 2 bodies.*{FIRST}"):
        assert read_kernels(file).ids.tolist() == [FIRST + 1]


def test_kernels_that_a_user_has_loaded_stay_as_they_are(kernel, tmp_path):
    own = tmp_path / "own.bsp"
    write_kernel(own, FIRST, kepler_states(1), START, END)
    spiceypy.furnsh(str(kernel))
    spiceypy.furnsh(str(own))
    try:
        spiceypy.pdpool("MINE", [1.0])
        before = spiceypy.spkgeo(FIRST, float(seconds(11500.0)), "J2000", 10)[0]
        catalogue = read_kernels(kernel, (), "spk", WINDOW)
        kernel_again = spiceypy.spkgeo(FIRST, float(seconds(11500.0)), "J2000", 10)[0]
        assert np.array_equal(before, kernel_again)
        assert spiceypy.ktotal("ALL") == 2
        assert spiceypy.gdpool("MINE", 0, 1).tolist() == [1.0]
    finally:
        spiceypy.kclear()
    # The user's own kernel, loaded later, plays no part in the catalogue.
    assert off(catalogue.states(11500.0)[[0]], truth([kernel], FIRST, [11500.0]))[0] < 1.0
    assert spiceypy.ktotal("ALL") == 0


def test_threads_read_kernels_side_by_side(kernel):
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: read_kernels(kernel, (), "spk", WINDOW), range(8)))
    assert len({catalogue.ephemeris.digest for catalogue in found}) == 1


def _planets():
    """Return a planetary kernel with the Sun, of the package skyfield-data."""
    data = pytest.importorskip("skyfield_data", reason="skyfield-data has the planetary kernel")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Path(data.get_skyfield_data_path()) / "de421.bsp"


def _real(tmp_path, *names):
    """Return a folder with links to published kernels and the planets."""
    if not REAL.is_dir():
        pytest.skip("the published kernels (../shared/real) are not here")
    folder = tmp_path / "kernels"
    folder.mkdir()
    for file in (*(REAL / name for name in names), _planets()):
        (folder / file.name).symlink_to(file)
    return folder


@pytest.mark.parametrize(
    ("name", "window"),
    [
        ("spk01_ryugu.bsp", (8000.0, 12000.0)),
        ("spk21_ryugu.bsp", (8000.0, 12000.0)),
        ("spk21_ceres.bsp", (8000.0, 12000.0)),
        ("spk02_bennu.bsp", (5500.0, 8500.0)),
        ("spk13_spitzer.bsp", (1400.5, 8000.0)),
    ],
)
def test_published_kernels_are_met_to_a_metre(tmp_path, name, window):
    folder = _real(tmp_path, name)
    check_table(folder, sorted(folder.iterdir()), window, n=1500)


def test_a_body_is_the_same_in_kernels_of_two_types(tmp_path):
    epochs = np.linspace(8000.0, 12000.0, 300)
    found = []
    for name in ("spk01_ryugu.bsp", "spk21_ryugu.bsp"):
        part = tmp_path / name
        part.mkdir()
        catalogue = read_kernels(_real(part, name), (), "spk", (8000.0, 12000.0))
        found.append(catalogue.states_at(np.zeros(300, dtype=int), epochs))
    position, velocity = off(*found)
    # SPICE itself finds the two files up to 30.01 m and 5.9 um/s apart.
    assert position < 31.0
    assert velocity < 1e-5


def test_a_kernel_of_one_day_says_what_it_covers(tmp_path):
    if not REAL.is_dir():
        pytest.skip("the published kernels (../shared/real) are not here")
    said = one_line(
        REAL / "spk02_planets_one_day.bsp", "is covered", [399], "spk", (8000.0, 9000.0)
    )
    assert "399 EARTH" in said
    assert "2015-02-27 to 2015-03-07" in said
