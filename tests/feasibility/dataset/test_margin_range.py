"""Initial masses that follow from m*, several a leg, and the sampler of transfers."""

import msgspec
import numpy as np
import pytest

from feasibility import InputError
from feasibility.constants import AU
from feasibility.dataset import Protocol, begin, read_dataset
from feasibility.dataset.protocol import CatalogueTable
from feasibility.dataset.samplers.transfers import Transfers
from feasibility.orbits import earth

SAMPLER = Transfers(
    departures=("earth", "catalogue"), arrivals=("mars", "catalogue"), revolutions=(0.3, 1.5)
)
PROTOCOL = Protocol(
    name="transfers",
    sampler=SAMPLER,
    margin_range=(1.0, 10.0),
    masses_per_leg=3,
    legs_per_shard=9,
    catalogue=CatalogueTable(synthetic_bodies=40),
)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flown")
    begin(PROTOCOL, 18, folder, seed=4).run()
    return read_dataset(folder)


def test_all_legs_can_be_flown_and_margins_fill_the_range(dataset):
    log_margin = dataset.columns["log_margin"]
    solved = np.isfinite(log_margin)
    assert solved.mean() > 0.8
    assert (log_margin[solved] >= 0.0).all()
    assert (log_margin[solved] <= np.log(10.0) * (1 + 1e-12)).all()
    assert np.ptp(log_margin[solved]) > 1.0
    flown = dataset.columns["m_final_kg"][solved]
    assert np.isfinite(flown).mean() > 0.8
    assert (flown[np.isfinite(flown)] > 0.0).all()
    assert not (flown >= dataset.legs.m0[solved]).any()


def test_rows_of_one_leg_differ_in_the_initial_mass_alone(dataset):
    legs = dataset.legs
    for first in range(0, len(legs), 3):
        rows = slice(first, first + 3)
        for column in (legs.tof_days, legs.thrust, legs.isp, legs.dep_id, legs.arr_id):
            assert len(set(column[rows])) == 1
        assert len(set(legs.m0[rows])) == 3
    assert len(set(legs.tof_days)) == 6
    planets = legs.dep_id < 0
    # Ids of planets tell legs apart, so that splits by pair keep their rows together.
    assert len(set(legs.dep_id[planets])) == planets.sum() // 3


def test_a_shorter_dataset_is_the_beginning_of_a_longer_one(dataset, tmp_path):
    begin(PROTOCOL, 13, tmp_path, seed=4).run()
    short = read_dataset(tmp_path)
    for name, column in short.columns.items():
        if name != "seconds":
            np.testing.assert_array_equal(column, dataset.columns[name][:13])


def test_protocols_that_do_not_fit_are_refused():
    changes = [
        ({"margin_range": None}, "masses_per_leg: expected a margin_range"),
        ({"margin_range": (2.0, 1.0)}, r"margin_range = \[2, 1\], expected the smaller one first"),
        ({"boundary_share": 0.5}, "no boundary_share"),
        ({"label": "convergence"}, 'expected label = "margin"'),
    ]
    for change, message in changes:
        with pytest.raises(ValueError, match=message):
            msgspec.structs.replace(PROTOCOL, **change).__post_init__()


def test_settings_that_are_not_used_leave_no_trace():
    plain = msgspec.structs.replace(PROTOCOL, margin_range=None, masses_per_leg=1).to_dict()
    assert not {"margin_range", "masses_per_leg"} & set(plain)
    assert PROTOCOL.to_dict()["masses_per_leg"] == 3


def test_legs_begin_and_end_where_the_sampler_says():
    rng = np.random.default_rng(0)
    sampler = Transfers(departures=("earth",), arrivals=("mars", "earth"), tof_days=(200.0, 900.0))
    catalogue = earth()
    with pytest.raises(InputError, match="expected two or more"):
        sampler.draw(5, rng, catalogue, None, PROTOCOL.impulsive_grid)
    from feasibility.dataset.labels import load_catalogue

    catalogue = load_catalogue(PROTOCOL.catalogue, None)
    drawn = sampler.draw(50, rng, catalogue, None, PROTOCOL.impulsive_grid)
    legs = drawn.legs
    assert legs.dep_id.tolist() == legs.arr_id.tolist() == [-1] * 50
    at = [np.linalg.norm(states[:, :3], axis=1) / AU for states in (legs.rv_dep, legs.rv_arr)]
    assert (np.abs(at[0] - 1.0) < 0.02).all()
    assert (np.abs(at[1] - 1.52) < 0.15).all()
    assert ((legs.tof_days >= 200.0) & (legs.tof_days <= 900.0)).all()
    assert (drawn.m0_min < legs.m0).all()
