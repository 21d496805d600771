"""Problems whose legs have free ends: launches, fly-bys, and arrivals with some speed left."""

import msgspec
import numpy as np
import pytest

from feasibility import InputError, KeepAll
from seqsearch import SearchSettings, check_problem, search
from seqsearch.core.nodes import Nodes
from seqsearch.polish.itinerary import Itinerary
from seqsearch.polish.retiming import retime
from seqsearch.problems.problem_file import build_problem, read_config
from seqsearch.refine import refine_tour
from seqsearch.tours.display import rows
from seqsearch.tours.events import FlyBy, Launch
from seqsearch.tours.export.json_file import document
from seqsearch.tours.export.protocol import Flight
from seqsearch.tours.paths import impulsive_trajectory
from seqsearch.tours.records import LARGEST_M_STAR_KG
from seqsearch.tours.tour_files import read_tour, to_csv, to_json
from seqsearch.tours.verify import verify_tour
from seqsearch.tours.verify_rows import verify_rows
from tests.helpers.problem_texts import GOOD


class Nothing:
    """Knows nothing of any leg, as a model does that has not seen free ends."""

    def margin(self, legs, /):
        return np.full(len(legs), np.nan)

    final_mass = margin


def written(tmp_path, ends, mission="", text=GOOD):
    path = tmp_path / "mine.toml"
    text = text.replace("min_stay_days = 30", mission or "min_stay_days = 30")
    path.write_text(text + "\n[ends]\n" + ends)
    return path


def problem(tmp_path, ends, mission=""):
    return build_problem(read_config(str(written(tmp_path, ends, mission))))


SETTINGS = SearchSettings().with_(
    beam_width=4,
    starts=6,
    start_epochs=2,
    neighbours=10,
    solves_per_rank=40,
    tof_days_min=60.0,
    tof_days_max=300.0,
    tof_days_step=40.0,
    audit={"per_rank": 0},
)


@pytest.fixture(scope="module")
def passed(tmp_path_factory):
    """A searched tour of fly-bys, with its problem."""
    tmp_path = tmp_path_factory.mktemp("passed")
    here = problem(tmp_path, 'launch_vinf_km_s = 3.0\nvisits = "fly-by"', "min_stay_days = 0")
    return here, search(here, pruner=KeepAll(), predictor=Nothing(), settings=SETTINGS).tour


@pytest.mark.parametrize(
    ("ends", "mission", "said"),
    [
        ("launch_vinf_km_s = 4000.0", "", "is it in m/s"),
        ("launch_vinf_km_s = -1.0", "", "launch_vinf_km_s"),
        ("launch_vinf_km_s = inf", "", "expected a finite number"),
        ('launch_from = "mars"', "", "launch_from"),
        ('visits = "flyby"', "", "visits"),
        ('visits = "fly-by"', "", "min_stay_days = 30"),
        ("visit_vinf_km_s = 3.0", "", 'without visits = "fly-by"'),
        ("arrival_vinf_km_s = 3.0", "", "without a body at which tours end"),
        ("vinf = 3.0", "", "vinf"),
        ('launch_from = "earth"', "min_stay_days = 0\nstart_ids = [5]", "start_ids"),
    ],
)
def test_what_ends_cannot_be_is_refused_in_one_line(tmp_path, ends, mission, said):
    with pytest.raises(InputError, match=said) as error:
        problem(tmp_path, ends, mission)
    assert "\n" not in str(error.value)
    assert "mine" in str(error.value)


@pytest.mark.parametrize(
    ("ends", "mission"),
    [
        ('launch_from = "earth"\nlaunch_vinf_km_s = 4.0', ""),
        ("launch_vinf_km_s = 1.0", ""),
        ('launch_vinf_km_s = 4.0\nvisits = "fly-by"', "min_stay_days = 0"),
        ('visits = "fly-by"\nvisit_vinf_km_s = 5.0', "min_stay_days = 0"),
    ],
)
def test_problems_with_ends_keep_the_contract(tmp_path, ends, mission):
    check_problem(problem(tmp_path, ends, mission), predictor=Nothing())


def test_hops_have_the_ends_that_the_file_states(tmp_path):
    launched = problem(tmp_path, 'launch_from = "earth"\nlaunch_vinf_km_s = 4.0')
    assert launched.start_ids == (0,)
    rows, epochs = launched.start_rows(), np.array([launched.first_departure_mjd2000[0]])
    start = launched.start_nodes(rows, epochs)
    hops = launched.hops(start, np.array([0]), np.array([7]), epochs, np.array([300.0]))
    assert hops.legs[0].vinf_dep[0] == pytest.approx(4000.0, rel=1e-5)
    assert hops.legs[0].vinf_dep[0] < 4000.0
    assert hops.legs[0].vinf_arr[0] == 0.0
    (event,) = launched.tour_rules().events
    assert isinstance(event, Launch)
    assert (event.speed_max_m_s, event.planet.name) == (4000.0, "Earth")
    assert not launched.tour_rules().start_counts


def test_a_leg_after_a_fly_by_begins_with_the_velocity_of_the_spacecraft(tmp_path):
    passing = problem(tmp_path, 'visits = "fly-by"', "min_stay_days = 0")
    velocity = np.array([[1200.0, -300.0, 50.0]])
    epoch = np.array([11000.0])
    start = passing.start_nodes(np.array([3]), epoch)
    node = Nodes(
        *(getattr(start, name) for name in Nodes.__dataclass_fields__ if name != "velocity"),
        velocity=velocity,
    )
    hops = passing.hops(node, np.array([0]), np.array([7]), epoch, np.array([200.0]))
    body = passing.catalogue.states_at([3], epoch)
    np.testing.assert_allclose(hops.legs[0].rv_dep[:, 3:] - body[:, 3:], velocity, atol=1e-9)
    assert np.isinf(hops.legs[0].vinf_arr[0])


def test_nodes_without_velocities_are_at_rest():
    nodes = Nodes.at_start(np.array([1, 2]), np.zeros(2), np.ones(2))
    assert nodes.velocity.shape == (2, 3)
    assert not nodes.velocity.any()
    assert not Nodes.concatenate([nodes, nodes.take(np.array([1]))]).velocity.any()


def test_a_tour_of_fly_bys_is_verified_and_written(passed, tmp_path):
    here, tour = passed
    assert len(tour.legs) >= 2
    assert [body.id for body in tour.bodies[1:]] == [leg.to_id for leg in tour.legs]
    speeds = [np.linalg.norm(leg.arr_velocity_m_s) for leg in tour.legs]
    assert min(speeds) > 100.0
    launch = np.linalg.norm(tour.legs[0].dep_velocity_m_s)
    assert 0.0 < launch <= 3000.0
    for one, other in zip(tour.legs, tour.legs[1:], strict=False):
        assert other.dep_velocity_m_s == pytest.approx(one.arr_velocity_m_s, abs=1e-6)
        assert other.t_dep_mjd2000 == pytest.approx(one.t_arr_mjd2000)
    path = tmp_path / "sequence.json"
    path.write_text(to_json(tour))
    assert read_tour(path) == tour
    assert f"{launch:.6f}" in to_csv(tour)
    verification = verify_tour(tour, here.catalogue, here.tour_rules())
    assert verification.passed, verification.table()


@pytest.mark.parametrize(
    ("change", "failed"),
    [
        ({"launch": 2000.0}, "launch speed"),
        ({"visit": 100.0}, "speed of visits"),
        ({"visit": 0.0}, "fly-bys"),
    ],
)
def test_bounds_are_checked_from_the_rules_and_not_from_the_tour(passed, change, failed):
    here, tour = passed
    rules = here.tour_rules()
    visit = change.get("visit")
    launch = Launch(planet=None, speed_max_m_s=change.get("launch", 3000.0))
    events = (launch, FlyBy(speed_min_m_s=0.0, times=0, visit_max_m_s=visit))
    strict = msgspec.structs.replace(rules, events=events)
    legs = tour.legs
    if "launch" in change:
        fast = msgspec.structs.replace(legs[0], dep_velocity_m_s=(2900.0, 0.0, 0.0))
        tour = msgspec.structs.replace(tour, legs=(fast, *legs[1:]))
    names = {check.name for check in verify_tour(tour, rules=strict).checks if not check.passed}
    assert failed in names


def test_an_excess_that_is_not_flown_is_found_out(passed):
    here, tour = passed
    legs = list(tour.legs)
    x, y, z = legs[0].dep_velocity_m_s
    legs[0] = msgspec.structs.replace(legs[0], dep_velocity_m_s=(0.5 * x, 0.5 * y, 0.5 * z))
    slower = msgspec.structs.replace(tour, legs=tuple(legs))
    names = {c.name for c in verify_tour(slower, rules=here.tour_rules()).checks if not c.passed}
    assert "position at each arrival" in names


def test_a_tour_of_fly_bys_is_refined_and_its_rows_verified(passed):
    here, tour = passed
    trajectory = refine_tour(tour).trajectory
    bodies = {str(body.id): body for body in tour.bodies}
    rules = here.tour_rules()
    verification = verify_rows(trajectory, bodies, rules)
    assert verification.passed, verification.table()
    slow = FlyBy(speed_min_m_s=0.0, times=0, visit_max_m_s=50.0)
    strict = msgspec.structs.replace(rules, events=(rules.events[0], slow))
    failed = {c.name for c in verify_rows(trajectory, bodies, strict).checks if not c.passed}
    assert "speed of visits" in failed
    still = msgspec.structs.replace(rules, events=(slow,))
    failed = {c.name for c in verify_rows(trajectory, bodies, still).checks if not c.passed}
    assert "velocity at each departure" in failed


def test_exports_have_the_excess_velocities(passed):
    _, tour = passed
    flight = Flight(tour, impulsive_trajectory(tour))
    legs = document(flight)["legs"]
    for leg, told in zip(tour.legs, legs, strict=True):
        for end, velocity in (
            ("departure", leg.dep_velocity_m_s),
            ("arrival", leg.arr_velocity_m_s),
        ):
            np.testing.assert_allclose(told[f"{end}_excess_km_s"], np.divide(velocity, 1e3))
    assert all(row["arr_speed_m_s"] > 100.0 for row in rows(tour))


def test_a_tour_of_rendezvous_may_not_pass_its_bodies(passed):
    _, tour = passed
    plain = msgspec.structs.replace(tour.rules, events=())
    names = {check.name for check in verify_tour(tour, rules=plain).checks if not check.passed}
    assert {"launch speed", "fly-bys of bodies met before, once each"} <= names


@pytest.fixture(scope="module")
def launched(tmp_path_factory):
    """A tour that is launched from a body of the table, with its problem."""
    here = problem(tmp_path_factory.mktemp("launched"), "launch_vinf_km_s = 2.0")
    settings = SETTINGS.with_(starts=10, tof_days_min=120.0, tof_days_max=360.0)
    return here, search(here, pruner=KeepAll(), settings=settings, max_solves=200).tour


def test_a_launched_tour_goes_on_at_rest(launched):
    here, tour = launched
    assert len(tour.legs) >= 1
    assert np.linalg.norm(tour.legs[0].dep_velocity_m_s) > 1.0
    assert not any(any(leg.dep_velocity_m_s) for leg in tour.legs[1:])
    assert not any(any(leg.arr_velocity_m_s) for leg in tour.legs)
    assert verify_tour(tour, here.catalogue, here.tour_rules()).passed


def test_a_launched_tour_can_be_retimed(launched):
    here, tour = launched
    itinerary = Itinerary.from_tour(here, tour)
    assert itinerary.vinf_dep[0] == 2000.0
    assert not itinerary.part(1, len(itinerary)).vinf_dep.any()
    retimed = retime(here, itinerary, max_iterations=4)
    assert retimed is not None
    assert retimed.flight.itinerary.duration_days <= tour.duration_days + 1e-6
    if retimed.flight.keeps_rules(here):
        better = retimed.flight.to_tour(here)
        assert verify_tour(better, here.catalogue, here.tour_rules()).passed


def test_a_tour_of_fly_bys_has_no_itinerary_of_single_legs(passed):
    here, tour = passed
    with pytest.raises(InputError, match="fly-bys"):
        Itinerary.from_tour(here, tour)


def test_a_leg_that_needs_no_thrust_has_a_number_in_the_file(tmp_path):
    passing = problem(tmp_path, 'launch_vinf_km_s = 60.0\nvisits = "fly-by"', "min_stay_days = 0")
    settings = SETTINGS.with_(starts=2, beam_width=1, solves_per_rank=4)
    tour = search(
        passing, pruner=KeepAll(), predictor=Nothing(), settings=settings, max_solves=8
    ).tour
    assert tour.legs[0].m_star_kg == LARGEST_M_STAR_KG
    assert tour.legs[0].m_final_kg == tour.legs[0].m0_kg
    assert verify_tour(tour, rules=passing.tour_rules()).passed
