"""Samplers draw what their protocols say."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from feasibility import InputError
from feasibility.constants import AU, DAY_S, MU_SUN, mjd_to_mjd2000
from feasibility.dataset import Protocol, begin, builtin_protocols, read_dataset, read_protocol
from feasibility.dataset.protocol import CatalogueTable, SpacecraftTable
from feasibility.dataset.samplers.draws import Draw, collect, legs_of_pairs
from feasibility.dataset.samplers.impulsive import ImpulsiveGrid
from feasibility.dataset.samplers.protocol import Sampler
from feasibility.dataset.samplers.random_pairs import RandomPairs
from feasibility.orbits import (
    Catalogue,
    cartesian_to_classical,
    orbital_metric,
    synthetic_main_belt,
)
from feasibility.orbits.lambert import lambert_delta_v
from feasibility.runtime.pykep_guard import load_pykep

BELT = synthetic_main_belt(300, np.random.default_rng(3))
COARSE = ImpulsiveGrid(step_days=40.0, fine_step_days=10.0)
seeds = st.integers(0, 2**32 - 1)


def draw(name: str, seed: int, n: int = 60, grid: ImpulsiveGrid = COARSE, **changes) -> Draw:
    protocol = read_protocol(name)
    sampler = msgspec.structs.replace(protocol.sampler, **changes)
    return sampler.draw(n, np.random.default_rng(seed), BELT, protocol.craft(), grid)


def assert_states_are_those_of_the_catalogue(legs) -> None:
    dep, arr = BELT.rows_of(legs.dep_id), BELT.rows_of(legs.arr_id)
    assert (dep != arr).all()
    np.testing.assert_array_equal(legs.rv_dep, BELT.states_at(dep, legs.t_dep_mjd2000))
    arrival = legs.t_dep_mjd2000 + legs.tof_days
    np.testing.assert_array_equal(legs.rv_arr, BELT.states_at(arr, arrival))


@settings(deadline=None, max_examples=15)
@given(seed=seeds)
def test_table1_is_table_1_of_the_paper(seed):
    drawn = draw("table1", seed)
    legs = drawn.legs
    assert len(legs) == 60
    first, last = mjd_to_mjd2000(58849), mjd_to_mjd2000(73459)
    assert (legs.t_dep_mjd2000 >= first).all()
    assert (legs.t_dep_mjd2000 <= last).all()
    assert ((legs.m0 >= 1000) & (legs.m0 <= 3000)).all()
    assert (legs.tof_days >= 1.2 * drawn.dt_imp_days - 1e-9).all()
    assert (legs.tof_days <= np.minimum(2 * drawn.dt_imp_days, 1460) + 1e-9).all()
    assert ((drawn.dt_imp_days >= 60) & (drawn.dt_imp_days <= 1460)).all()
    assert (legs.thrust == 0.236).all()
    assert (legs.isp == 4190).all()
    assert (legs.m_dry == 1000).all()
    assert_states_are_those_of_the_catalogue(legs)


def test_table1_fills_its_ranges():
    drawn = draw("table1", 1, n=3000)
    place = (drawn.legs.m0 - 1000) / 2000
    longest = np.minimum(2 * drawn.dt_imp_days, 1460)
    shortest = 1.2 * drawn.dt_imp_days
    for uniform in (place, (drawn.legs.tof_days - shortest) / (longest - shortest)):
        assert np.abs(np.quantile(uniform, [0.25, 0.5, 0.75]) - [0.25, 0.5, 0.75]).max() < 0.04


@settings(deadline=None, max_examples=5)
@given(seed=seeds)
def test_dt_imp_has_the_lowest_delta_v_of_the_grid_by_pykep(seed):
    rng = np.random.default_rng(seed)
    grid = ImpulsiveGrid(step_days=25.0, fine_step_days=5.0)
    dep = rng.integers(0, 150, 5)
    arr = rng.integers(150, 300, 5)
    t_dep = rng.uniform(7000, 20000, 5)
    best = grid.best_tof_days(BELT, dep, arr, t_dep)

    for leg in range(5):

        def cost(tof_days, leg=leg):
            return pykep_delta_v(dep[leg], arr[leg], t_dep[leg], tof_days)

        coarse = [cost(tof) for tof in np.arange(60.0, 1460.1, 25.0)]
        centre = 60.0 + 25.0 * int(np.argmin(coarse))
        fine = [tof for tof in centre + np.arange(-25.0, 25.1, 5.0) if 60 <= tof <= 1460]
        assert cost(best[leg]) == pytest.approx(min(map(cost, fine)), rel=1e-9)


def pykep_delta_v(dep: int, arr: int, t_dep: float, tof_days: float) -> float:
    departure = BELT.states_at([dep], t_dep)[0]
    arrival = BELT.states_at([arr], t_dep + tof_days)[0]
    arcs = load_pykep().lambert_problem(
        r0=departure[:3].tolist(),
        r1=arrival[:3].tolist(),
        tof=tof_days * DAY_S,
        mu=MU_SUN,
        cw=False,
        multi_revs=1,
    )
    return min(
        np.linalg.norm(np.array(v0) - departure[3:]) + np.linalg.norm(arrival[3:] - np.array(v1))
        for v0, v1 in zip(arcs.v0, arcs.v1, strict=True)
    )


def test_the_grid_has_both_ends_and_refines_within_them():
    grid = ImpulsiveGrid(tof_days_min=60, tof_days_max=900, step_days=400, fine_step_days=200)
    n = len(BELT) - 1
    dep, arr, t_dep = np.arange(n), np.arange(n) + 1, np.full(n, 8000.0)
    best = grid.best_tof_days(BELT, dep, arr, t_dep)

    def cheapest(times):
        costs = [
            lambert_delta_v(
                BELT.states_at(dep, t_dep), BELT.states_at(arr, t_dep + time), time * DAY_S, 1
            )
            for time in times
        ]
        return np.asarray(times)[np.argmin(costs, axis=0)]

    rough = cheapest([60.0, 460.0, 860.0, 900.0])
    assert {460.0, 860.0, 900.0} <= set(rough)
    around = {60.0: (60, 260, 460), 460.0: (60, 260, 460, 660, 860)}
    around |= {860.0: (460, 660, 860, 900), 900.0: (500, 700, 900)}
    for centre, times in around.items():
        rows = rough == centre
        np.testing.assert_array_equal(best[rows], cheapest([float(t) for t in times])[rows])


@settings(deadline=None, max_examples=10)
@given(seed=seeds, max_de=st.floats(0.02, 0.2), max_di=st.floats(1.0, 9.0))
def test_limited_pairs_have_similar_orbits(seed, max_de, max_di):
    legs = draw("limited", seed, n=20, max_de=max_de, max_di_deg=max_di).legs
    dep = BELT.elements[BELT.rows_of(legs.dep_id)]
    arr = BELT.elements[BELT.rows_of(legs.arr_id)]
    assert (np.abs(dep[:, 1] - arr[:, 1]) <= max_de).all()
    assert (np.degrees(np.abs(dep[:, 2] - arr[:, 2])) <= max_di + 1e-9).all()


def test_limited_has_the_limits_of_the_issue():
    sampler = read_protocol("limited").sampler
    assert (sampler.max_de, sampler.max_di_deg) == (0.15, 8.0)


def test_limits_that_no_pair_meets_are_an_error():
    with pytest.raises(InputError, match="within its limits"):
        draw("limited", 0, n=10, max_de=1e-12)


@settings(deadline=None, max_examples=10)
@given(seed=seeds)
def test_search_candidates_are_near_neighbours(seed):
    drawn = draw("search", seed, n=40, neighbours=10, epochs=4)
    legs = drawn.legs
    assert_states_are_those_of_the_catalogue(legs)
    for dep, arr, t_dep in zip(
        BELT.rows_of(legs.dep_id), BELT.rows_of(legs.arr_id), legs.t_dep_mjd2000, strict=True
    ):
        points = orbital_metric(BELT.states(30.0 * np.rint(t_dep / 30.0)), 180.0)
        distance = np.linalg.norm(points - points[dep], axis=1)
        nearer = (distance < distance[arr] * (1 - 1e-9)).sum()
        assert nearer <= 10
    assert len(np.unique(np.rint(legs.t_dep_mjd2000 / 30.0))) <= 4


def test_search_masses_and_times_follow_the_protocol():
    legs = draw("search", 5, n=3000).legs
    assert legs.m0.min() >= 800
    assert legs.m0.max() <= 2000
    assert legs.tof_days.min() >= 40
    assert legs.tof_days.max() <= 800
    assert (legs.tof_days > 400).mean() == pytest.approx(0.1, abs=0.03)
    assert (legs.thrust == 0.3).all()


@settings(deadline=None, max_examples=25)
@given(seed=seeds)
def test_general_stays_within_its_ranges(seed):
    drawn = draw("general", seed, n=100)
    legs = drawn.legs
    acceleration = legs.thrust / legs.m0
    assert ((acceleration >= 1e-5 * (1 - 1e-9)) & (acceleration <= 1e-3 * (1 + 1e-9))).all()
    assert ((legs.isp >= 1000) & (legs.isp <= 6000)).all()
    assert (legs.m_dry < legs.m0).all()
    dep, arr = cartesian_to_classical(legs.rv_dep), cartesian_to_classical(legs.rv_arr)
    for orbit in (dep, arr):
        assert ((orbit[:, 0] / AU >= 0.5 - 1e-9) & (orbit[:, 0] / AU <= 6 + 1e-9)).all()
        assert (orbit[:, 0] * (1 - orbit[:, 1]) >= 0.3 * AU * (1 - 1e-9)).all()
    smaller = np.minimum(dep[:, 0], arr[:, 0])
    period_days = 2 * np.pi * np.sqrt(smaller**3 / MU_SUN) / DAY_S
    assert (legs.tof_days <= 2 * period_days * (1 + 1e-9)).all()
    assert (drawn.m0_min <= legs.m0 * (1 + 1e-9)).all()
    assert (drawn.m0_max >= legs.m0 * (1 - 1e-9)).all()


def test_general_mixes_near_and_far_pairs_and_catalogue_bodies():
    legs = draw("general", 2, n=4000).legs
    a_dep = cartesian_to_classical(legs.rv_dep)[:, 0]
    a_arr = cartesian_to_classical(legs.rv_arr)[:, 0]
    apart = np.abs(np.log(a_arr / a_dep))
    assert 0.3 < (apart < 0.05).mean() < 0.8
    assert (apart > 0.5).mean() > 0.1
    assert 0.1 < (legs.dep_id > 0).mean() < 0.4
    assert (a_dep < 1.2 * AU).mean() > 0.15


@pytest.mark.parametrize("name", ["table1", "limited", "search", "general", "paper"])
def test_the_same_seed_draws_the_same_legs(name):
    first, again, other = draw(name, 7).legs, draw(name, 7).legs, draw(name, 8).legs
    for column in ("rv_dep", "rv_arr", "tof_days", "m0", "thrust", "isp", "m_dry"):
        np.testing.assert_array_equal(getattr(first, column), getattr(again, column))
    assert not np.array_equal(first.rv_dep, other.rv_dep)


def test_a_catalogue_of_one_body_has_no_pairs():
    lone = Catalogue([1], ["a"], 0.0, BELT.elements[:1], "lone.txt")
    protocol = read_protocol("table1")
    with pytest.raises(InputError, match=r"lone\.txt: 1 bodies, expected two or more"):
        protocol.sampler.draw(5, np.random.default_rng(0), lone, protocol.craft(), COARSE)


def test_collect_keeps_the_order_of_what_is_accepted():
    counter = iter(range(10**6))

    def batch(m):
        values = np.array([next(counter) for _ in range(m)])
        return {"value": values[values % 3 == 0]}

    np.testing.assert_array_equal(collect(50, batch)["value"], 3 * np.arange(50))


def test_every_built_in_protocol_reads():
    names = builtin_protocols()
    assert set(names) == {"table1", "limited", "search", "general", "paper", "transfers"}
    for name in names:
        assert read_protocol(name).name == name
    assert read_protocol("paper").label == "convergence"


MINE = """\
name = "mine"
[sampler]
kind = "random-pairs"
[spacecraft]
dry_mass_kg = 500.0
thrust_n = 0.1
isp_s = 3000
"""


def read_text(tmp_path: Path, text: str) -> Protocol:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    return read_protocol(str(file))


def test_a_file_of_ones_own_is_read_and_its_catalogue_is_beside_it(tmp_path):
    protocol = read_text(tmp_path, MINE + '[catalogue]\nfile = "table.txt"\n')
    assert protocol.craft().thrust == 0.1
    assert protocol.catalogue.file == str(tmp_path / "table.txt")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "mine"', 'name = "mine"\nseed = 3', "unknown key 'seed' at top level"),
        ("thrust_n", "thrust_mn", "unknown key 'thrust_mn' in \\[spacecraft\\]"),
        ("[spacecraft]", "max_dee = 1\n[spacecraft]", "'max_dee' in \\[sampler\\]; .*max_de,"),
        ("random-pairs", "random", "invalid value 'random' .*at sampler"),
        ("isp_s = 3000", "isp_s = -1", "isp_s"),
        ("isp_s = 3000", 'isp_s = "x"', "isp_s"),
        ("[spacecraft]", "m0_kg = [3.0, 2.0]\n[spacecraft]", "smaller number first"),
        ("500.0", "1500.0", "below dry_mass_kg"),
        ("[sampler]", "boundary_share = 2\n[sampler]", "boundary_share"),
        ("name =", "name", "not valid TOML"),
    ],
)
def test_mistakes_in_a_file_are_named_with_file_and_key(tmp_path, old, new, message):
    assert old in MINE
    with pytest.raises(InputError, match=f"mine\\.toml: .*{message}"):
        read_text(tmp_path, MINE.replace(old, new, 1))


def test_the_spacecraft_is_given_where_it_is_not_drawn_and_only_there(tmp_path):
    with pytest.raises(InputError, match=r"no table \[spacecraft\]"):
        read_text(tmp_path, MINE.partition("[spacecraft]")[0])
    with pytest.raises(InputError, match="draws its own"):
        read_text(tmp_path, MINE.replace("random-pairs", "any-spacecraft"))


def test_an_unknown_protocol_lists_the_known_ones():
    with pytest.raises(InputError, match="built-in protocols are general, limited, paper"):
        read_protocol("tabel1")


def test_independent_orbits_have_time_for_the_transfer():
    legs = draw("general", 6, n=500, near_share=0.0).legs
    dep, arr = cartesian_to_classical(legs.rv_dep), cartesian_to_classical(legs.rv_arr)
    hohmann_s = np.pi * np.sqrt(((dep[:, 0] + arr[:, 0]) / 2) ** 3 / MU_SUN)
    assert (legs.tof_s >= 0.6 * hohmann_s * (1 - 1e-9)).all()


@dataclass(frozen=True)
class Neighbours:
    """A sampler of somebody else: from each body to the next of the table."""

    tof_days: float
    m0_kg: tuple[float, float] = (900.0, 900.0)
    draws_spacecraft: ClassVar[bool] = False

    def draw(self, n, rng, catalogue, spacecraft, grid) -> Draw:
        dep = rng.integers(0, len(catalogue) - 1, n)
        rows = {"dep": dep, "arr": dep + 1, "t_dep": np.full(n, 8000.0)}
        rows["tof"] = np.full(n, self.tof_days)
        mass = np.full(n, 900.0)
        return Draw(
            legs_of_pairs(catalogue, rows, mass, spacecraft), np.full(n, np.nan), mass, mass
        )


def test_a_sampler_of_ones_own_makes_a_dataset_that_is_resumed_by_an_equal_one_only(tmp_path):
    def protocol(sampler: Sampler) -> Protocol:
        return Protocol(
            name="neighbours",
            sampler=sampler,
            spacecraft=SpacecraftTable(dry_mass_kg=500, thrust_n=0.3, isp_s=3000),
            catalogue=CatalogueTable(synthetic_bodies=50),
            propellant=False,
            legs_per_shard=3,
        )

    begin(protocol(Neighbours(400.0)), 3, tmp_path).run()
    begin(protocol(Neighbours(400.0)), 6, tmp_path).run()
    data = read_dataset(tmp_path)
    assert (data.legs.arr_id == data.legs.dep_id + 1).all()
    assert data.metadata["protocol"]["sampler"]["kind"].endswith("test_samplers.Neighbours")
    with pytest.raises(InputError, match=r"protocol\.sampler\.tof_days = 400\.0, now 500\.0"):
        begin(protocol(Neighbours(500.0)), 6, tmp_path)
    with pytest.raises(InputError, match=r"sampler\.kind = .*Neighbours, now random-pairs"):
        begin(protocol(RandomPairs(m0_kg=(900.0, 900.0))), 6, tmp_path)
    with pytest.raises(ValueError, match="below dry_mass_kg"):
        protocol(Neighbours(400.0, m0_kg=(400.0, 900.0)))
