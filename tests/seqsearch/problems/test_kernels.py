"""Problems whose bodies come from SPK kernels: found, recorded, verified against SPICE."""

import json
import shutil
import tomllib

import msgspec
import numpy as np
import pytest

from feasibility import InputError
from feasibility.orbits.spk.reading import read_kernels
from seqsearch import check_problem, load_problem, verify_tour
from seqsearch.commands.cli import main
from seqsearch.tours.bodies.told_motion import motion_of
from seqsearch.tours.motion import body_state
from seqsearch.tours.tour_files import read_tour, to_json
from tests.helpers.kernels import kepler_states, write_kernel
from tests.helpers.problem_texts import QUICK

FIRST = 2_000_101
PUSH_M = 3e9
"""By how much bodies are off their ellipses: 20 times what an arrival may miss."""

OPTIONS = ["--seed", "1", "--workers", "1", "--max-solves", "60", "-q"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with kernels of twelve bodies and a problem beside it for each ephemeris."""
    home = tmp_path_factory.mktemp("kernels")
    kernels = home / "bodies"
    kernels.mkdir()
    for row in range(12):
        write_kernel(
            kernels / f"half{row % 2}.bsp",
            FIRST + row,
            kepler_states(row, PUSH_M),
            10900.0,
            12300.0,
        )
    text = QUICK.replace("[59215, 60000]", "[62600, 62700]").replace("neighbours = 20", "")
    for ephemeris in ("kepler", "spk"):
        catalogue = f'file = "bodies"\nephemeris = "{ephemeris}"'
        changed = text.replace("synthetic_bodies = 300", catalogue)
        (home / f"{ephemeris}.toml").write_text(changed)
    for ephemeris in ("kepler", "spk"):
        problem, run = home / f"{ephemeris}.toml", home / f"run-{ephemeris}"
        assert main(["run", str(problem), "--out", str(run), *OPTIONS]) == 0
    return home


def _checks(folder, capsys, *options):
    code = main(["verify", str(folder), "--json", *options])
    checks = json.loads(capsys.readouterr().out)["checks"]
    return code, {check["name"]: check for check in checks}


@pytest.mark.parametrize("ephemeris", ["kepler", "spk"])
def test_a_run_on_kernels_completes_and_is_verified(folder, capsys, ephemeris):
    run = folder / f"run-{ephemeris}"
    tour = read_tour(run / "sequence.json")
    assert len(tour.legs) >= 1
    code, checks = _checks(run, capsys)
    assert code == 0, checks
    config = tomllib.loads((run / "config.toml").read_text())["catalogue"]
    assert config["ephemeris"] == ephemeris
    assert config["file"] == "../bodies"
    assert ("bodies where the kernels say" in checks) == (ephemeris == "spk")
    assert (run / "tour.png").stat().st_size > 10_000


def test_a_tour_remembers_its_kernels_and_where_the_bodies_were(folder):
    tour = read_tour(folder / "run-spk" / "sequence.json")
    assert {kernel.name for kernel in tour.rules.kernels} <= {"half0.bsp", "half1.bsp"}
    leg = tour.legs[0]
    expected = kepler_states(leg.from_id - FIRST, PUSH_M)(np.array([leg.t_dep_mjd2000]))[0]
    assert np.linalg.norm(np.array(leg.dep_body_state[:3]) - expected[:3]) < 1e5
    on_ellipse = body_state(tour.body(leg.from_id), leg.t_dep_mjd2000, tour.rules.mu_m3_s2)
    assert np.linalg.norm(on_ellipse[:3] - expected[:3]) > 1e7


def test_tours_on_kepler_orbits_have_the_same_file_as_before(folder):
    text = (folder / "run-kepler" / "sequence.json").read_text()
    for word in ("kernels", "body_state"):
        assert f'"{word}' not in text


def test_what_kepler_orbits_are_off_is_said_at_the_start(folder, tmp_path, capsys):
    options = [*OPTIONS[:-1], "--out", str(tmp_path / "run")]
    assert main(["run", str(folder / "kepler.toml"), *options]) == 0
    said = capsys.readouterr().out
    assert "bodies move on Kepler orbits of 2031-05-14" in said
    catalogue = read_kernels(folder / "bodies", (), "kepler", (11056.0, 11856.0))
    assert f"{catalogue.extra['kepler_error_km'].max():.3g}"[:3] in said
    assert main(["bodies", str(folder / "bodies")]) == 0
    said = capsys.readouterr().out
    assert "12 bodies, SPK kernel" in said
    assert "against the kernels" in said


def test_without_the_kernels_nothing_passes(folder, tmp_path, capsys):
    run = tmp_path / "elsewhere" / "run"
    shutil.copytree(folder / "run-spk", run)
    code = main(["verify", str(run)])
    said = capsys.readouterr().out
    assert code == 1
    assert "NOT verified" in said
    assert "arrivals are not checked; say where they are with --catalogue" in said
    code, _ = _checks(run, capsys, "--catalogue", str(folder / "bodies"))
    assert code == 0


def test_changed_kernels_are_noticed(folder, tmp_path, capsys):
    changed = tmp_path / "bodies"
    shutil.copytree(folder / "bodies", changed)
    write_kernel(changed / "half0.bsp", 2_000_900, kepler_states(0), 10900.0, 12300.0)
    write_kernel(changed / "half1.bsp", 2_000_901, kepler_states(1), 10900.0, 12300.0)
    tour = read_tour(folder / "run-spk" / "sequence.json")
    checks = verify_tour(tour, kernels=sorted(changed.iterdir())).checks
    failed = {check.name for check in checks if not check.passed}
    assert "kernels of the bodies at hand" in failed
    assert "arrivals against the kernels" in failed


def _failed(folder, tour):
    kernels = sorted((folder / "bodies").iterdir())
    return {check.name for check in verify_tour(tour, kernels=kernels).checks if not check.passed}


def test_tampering_with_bodies_is_noticed(folder):
    tour = read_tour(folder / "run-spk" / "sequence.json")
    assert _failed(folder, tour) == set()
    leg = tour.legs[0]
    moved = (leg.arr_body_state[0] + 10.0, *leg.arr_body_state[1:])
    legs = (msgspec.structs.replace(leg, arr_body_state=moved), *tour.legs[1:])
    changed = msgspec.structs.replace(tour, legs=legs)
    assert _failed(folder, changed) == {"bodies where the kernels say"}
    # A tour that leaves its kernels out is no tour on Kepler orbits.
    rules = msgspec.structs.replace(tour.rules, kernels=msgspec.UNSET)
    silent = msgspec.structs.replace(tour, rules=rules)
    assert {"bodies move by their elements", "position at each arrival"} <= _failed(folder, silent)


def test_a_tour_of_another_time_is_not_covered_in_one_line(folder):
    tour = read_tour(folder / "run-spk" / "sequence.json")
    late = msgspec.structs.replace(tour.legs[0], t_dep_mjd2000=30000.0)
    changed = msgspec.structs.replace(tour, legs=(late, *tour.legs[1:]))
    assert "arrivals against the kernels" in _failed(folder, changed)


def test_tours_with_kernels_are_written_and_read_back(folder, tmp_path):
    tour = read_tour(folder / "run-spk" / "sequence.json")
    (tmp_path / "tour.json").write_text(to_json(tour))
    assert read_tour(tmp_path / "tour.json") == tour


def test_between_told_epochs_bodies_move_nearly_as_in_the_kernels(folder):
    tour = read_tour(folder / "run-spk" / "sequence.json")
    leg = tour.legs[0]
    body = tour.body(leg.to_id)
    at = motion_of(tour, body, [leg.t_arr_mjd2000])[0]
    assert np.allclose(at, leg.arr_body_state, rtol=1e-14)
    later = leg.t_arr_mjd2000 + np.array([1.0, 3.0])
    expected = kepler_states(leg.to_id - FIRST, PUSH_M)(later)
    error = np.linalg.norm((motion_of(tour, body, later) - expected)[:, :3], axis=1)
    assert error.max() < 1e7


def test_a_run_goes_on_with_the_same_kernels_alone(folder, tmp_path, capsys):
    run = tmp_path / "run"
    shutil.copytree(folder / "run-spk", run)
    shutil.copytree(folder / "bodies", tmp_path / "bodies")
    options = ["--max-solves", "80", "--workers", "1", "-q"]
    assert main(["resume", str(run), *options]) == 0
    for row in range(12):
        kernel = tmp_path / "bodies" / f"half{row % 2}.bsp"
        write_kernel(kernel, FIRST + row, kepler_states(row, 2 * PUSH_M), 10900.0, 12300.0)
    capsys.readouterr()
    assert main(["resume", str(run), "--max-solves", "100", "--workers", "1"]) == 2
    assert "not the asteroid table" in capsys.readouterr().err


def test_the_problem_honours_the_contract(folder):
    check_problem(load_problem(str(folder / "spk.toml")))


@pytest.mark.parametrize(
    ("catalogue", "words"),
    [
        ('file = "bodies"\nephemeris = "spice"', "ephemeris"),
        ('synthetic_bodies = 30\nephemeris = "spk"', "SPK kernel"),
        ("synthetic_bodies = 30\nbodies = [1]", "bodies"),
        ('file = "bodies"\nbodies = ["Vesta"]', "Vesta"),
        ('file = "bodies"\nephemeris = "spk"\n[gtoc5]', "Kepler"),
        ('file = "bodies"\nephemeris = "spk"\nselect = "a > 9"', "select"),
        ('file = "bodies"\nunits = {i = "rad"}', "units"),
    ],
)
def test_keys_that_cannot_be_used_are_named(folder, tmp_path, capsys, catalogue, words):
    text = (folder / "spk.toml").read_text()
    changed = text.replace('file = "bodies"\nephemeris = "spk"', catalogue)
    problem = folder / "changed.toml"
    problem.write_text(changed)
    assert main(["run", str(problem), "--out", str(tmp_path / "run")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert words in said
    assert not (tmp_path / "run").exists()


def test_bodies_of_kernels_are_chosen_and_selected(folder):
    text = (folder / "spk.toml").read_text()
    chosen = folder / "chosen.toml"
    bodies = (
        f'ephemeris = "spk"\nbodies = [101, "{FIRST + 4}", {FIRST + 2}]\nselect = "id != {FIRST}"'
    )
    chosen.write_text(text.replace('ephemeris = "spk"', bodies))
    problem = load_problem(str(chosen))
    assert problem.catalogue.ids.tolist() == [FIRST + 4, FIRST + 2]
    found = problem.catalogue.states(11500.0)
    expected = kepler_states(4, PUSH_M)(np.array([11500.0]))
    assert np.linalg.norm((found[0] - expected[0])[:3]) < 1e5


def test_a_window_that_is_not_covered_is_one_line(folder, tmp_path):
    text = (folder / "spk.toml").read_text().replace("[62600, 62700]", "[63000, 63900]")
    problem = folder / "late.toml"
    problem.write_text(text)
    with pytest.raises(InputError, match=rf"body {FIRST}.* is covered .*2033-09-04.*mission"):
        load_problem(str(problem))
