"""Labelled legs that several tests share: drawn as the paper does, labelled by a closed form."""

import functools
from pathlib import Path

import numpy as np

from feasibility.dataset import Dataset, read_protocol
from feasibility.dataset.columns import ARRIVAL_STATE, COLUMNS, DEPARTURE_STATE
from feasibility.dataset.storage import shard_path, write_metadata, write_shard
from feasibility.orbits import synthetic_main_belt
from feasibility.orbits.lambert import lambert_delta_v, with_lambert_excess
from feasibility.orbits.mima import mima


@functools.cache
def labelled_dataset(legs: int = 1500, seed: int = 0, bodies: int = 40) -> Dataset:
    """Return Table 1 legs among so few bodies that pairs recur; m* is half of MIMA's estimate.

    Solving them takes a hundred times longer, and a test of learning needs no better label.
    """
    protocol = read_protocol("table1")
    catalogue = synthetic_main_belt(bodies, np.random.default_rng(5))
    rng = np.random.default_rng(seed)
    draw = protocol.sampler.draw(legs, rng, catalogue, protocol.craft(), protocol.impulsive_grid)
    flown = draw.legs
    m_star = 2.0 * mima(
        flown.rv_dep, flown.rv_arr, flown.tof_s, flown.thrust, flown.exhaust_velocity
    )
    log_margin = np.log(m_star / flown.m0)
    columns = {
        "dep_id": flown.dep_id,
        "arr_id": flown.arr_id,
        "t_dep_mjd2000": flown.t_dep_mjd2000,
        "tof_days": flown.tof_days,
        "m0_kg": flown.m0,
        "thrust_n": flown.thrust,
        "isp_s": flown.isp,
        "m_dry_kg": flown.m_dry,
        "dt_imp_days": draw.dt_imp_days,
        "lambert_dv_m_s": lambert_delta_v(flown.rv_dep, flown.rv_arr, flown.tof_s, 2),
        "m_star_kg": m_star,
        "log_margin": log_margin,
        "m_final_kg": np.full(legs, np.nan),
        "status": np.where(log_margin >= 0, 0, 3),
        "start": np.zeros(legs),
        "seconds": np.zeros(legs),
        "boundary_draw": np.zeros(legs),
        "vinf_dep_m_s": np.zeros(legs),
        "vinf_arr_m_s": np.zeros(legs),
    }
    for state, names in ((flown.rv_dep, DEPARTURE_STATE), (flown.rv_arr, ARRIVAL_STATE)):
        columns |= {column.name: state[:, axis] for axis, column in enumerate(names)}
    typed = {column.name: np.asarray(columns[column.name], column.dtype) for column in COLUMNS}
    metadata = {
        "legs": legs,
        "seed": seed,
        "protocol": protocol.to_dict() | {"legs_per_shard": legs},
        "catalogue": {"bodies": bodies, "source": "synthetic main belt"},
    }
    return Dataset(typed, metadata)


@functools.cache
def labelled_free_dataset(legs: int = 1500, seed: int = 0, bodies: int = 40) -> Dataset:
    """Return the legs of `labelled_dataset` with free ends of all kinds, labelled as quickly.

    The closed form is asked about the ends of a Lambert arc with its excess cut to the bounds;
    m* is inf where nothing is left to do.
    """
    rest = labelled_dataset(legs, seed, bodies)
    rng = np.random.default_rng([seed, 1])
    bounds = rng.uniform(200.0, 3000.0, (2, legs))
    kind = rng.integers(1, 6, legs)
    vinf_dep = np.where(np.isin(kind, (1, 3, 5)), bounds[0], 0.0)
    vinf_arr = np.where(kind >= 4, np.inf, np.where(kind >= 2, bounds[1], 0.0))
    flown = rest.legs
    departure, arrival, left = with_lambert_excess(
        *(flown.rv_dep, flown.rv_arr, flown.tof_s, vinf_dep, vinf_arr)
    )
    m_star = 2.0 * mima(departure, arrival, flown.tof_s, flown.thrust, flown.exhaust_velocity)
    m_star[left == 0.0] = np.inf
    log_margin = np.log(m_star / flown.m0)
    changes = {
        "vinf_dep_m_s": vinf_dep,
        "vinf_arr_m_s": vinf_arr,
        "m_star_kg": m_star,
        "log_margin": log_margin,
        "status": np.where(log_margin >= 0, 0, 3),
    }
    typed = {
        column.name: np.asarray(changes[column.name], column.dtype)
        for column in COLUMNS
        if column.name in changes
    }
    return Dataset({**rest.columns, **typed}, rest.metadata)


def write_dataset(dataset: Dataset, folder: Path) -> Path:
    """Write a dataset as ``feasibility generate`` does."""
    folder.mkdir()
    write_metadata(folder, dataset.metadata)
    write_shard(shard_path(folder, 0), dataset.columns)
    return folder
