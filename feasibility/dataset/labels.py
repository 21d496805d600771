"""From a protocol to labelled rows: one shard, a pure function of seed and shard number."""

import functools
import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.dataset.columns import ARRIVAL_STATE, DEPARTURE_STATE
from feasibility.dataset.convergence import converge_from_random_start
from feasibility.dataset.protocol import CatalogueTable, Protocol
from feasibility.dataset.samplers.draws import Columns, Draw
from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.orbits import Catalogue, read_catalogue, synthetic_main_belt
from feasibility.orbits.lambert import lambert_delta_v
from feasibility.sims_flanagan import LegSolutions, Status, optimise, solve_max_initial_mass

LAMBERT_REVOLUTIONS: Final = 2
"""Revolutions of the Lambert branches that the column lambert_dv_m_s compares."""


@final
@dataclass(frozen=True)
class ShardTask:
    """All that a worker has to know to make one shard.

    Attributes
    ----------
    protocol : Protocol
        How to draw and label.
    seed : int
        Seed of the dataset.
    shard : int
        Number of the shard, from 0.
    rows : int
        How many of its first rows are wanted, at most ``protocol.legs_per_shard``.
    catalogue_sha256 : str, optional
        Digest of the catalogue file as the caller sees it.
    """

    protocol: Protocol
    seed: int
    shard: int
    rows: int
    catalogue_sha256: str | None


def file_sha256(table: CatalogueTable) -> str | None:
    """Return the digest of a catalogue file, None for a synthetic belt.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    if table.file is None:
        return None
    try:
        return hashlib.sha256(Path(table.file).read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{table.file}: cannot be read ({error.strerror})") from None


@functools.lru_cache(maxsize=1)
def load_catalogue(table: CatalogueTable, sha256: str | None) -> Catalogue:
    """Return the bodies of a protocol; a process keeps the last one.

    Raises
    ------
    InputError
        The file is missing or malformed, or its digest is not `sha256`.
    """
    if table.file is None:
        rng = np.random.default_rng(table.synthetic_seed)
        return synthetic_main_belt(table.synthetic_bodies, rng)
    if file_sha256(table) != sha256:
        raise InputError(f"{table.file}: differs between processes; expected the same file")
    return read_catalogue(Path(table.file))


def make_shard(task: ShardTask) -> Columns:
    """Draw and label the rows of one shard.

    The rows depend on protocol, seed and shard number alone; a shorter shard
    is the beginning of the full one.

    Returns
    -------
    dict of (rows,) arrays
        The columns of `columns.COLUMNS`.

    Raises
    ------
    InputError
        The catalogue cannot be used, or the sampler finds hardly a leg.
    """
    protocol = task.protocol
    sequence = np.random.SeedSequence(task.seed, spawn_key=(task.shard,))
    children = (np.random.default_rng(child) for child in sequence.spawn(4))
    sampling, boundary, starts, margins = children
    catalogue = load_catalogue(protocol.catalogue, task.catalogue_sha256)
    full = protocol.legs_per_shard
    draw = protocol.sampler.draw(
        full, sampling, catalogue, protocol.craft(), protocol.impulsive_grid
    ).head(task.rows)
    # Drawn for the whole shard even if fewer rows are wanted, so that these stay the same.
    chosen = boundary.uniform(size=full)[: task.rows] < protocol.boundary_share
    log_ratio = protocol.boundary_sigma * boundary.standard_normal(full)[: task.rows]
    if protocol.label == "convergence":
        labels = _convergence_labels(draw, protocol.solver, starts)
    elif protocol.margin_range is not None:
        # Again for the whole shard.
        low, high = (float(np.log(margin)) for margin in protocol.margin_range)
        log_margin = margins.uniform(low, high, full)[: task.rows]
        labels = _margin_range_labels(draw, protocol, log_margin)
    else:
        labels = _margin_labels(draw, protocol, chosen, log_ratio)
    legs: Legs = labels.pop("legs")
    delta_v = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s, LAMBERT_REVOLUTIONS)
    return {
        **_leg_columns(legs, task),
        "dt_imp_days": draw.dt_imp_days,
        "lambert_dv_m_s": np.where(np.isfinite(delta_v), delta_v, np.nan),
        **labels,
    }


def _margin_labels(
    draw: Draw, protocol: Protocol, chosen: NDArray[np.bool_], log_ratio: NDArray[np.float64]
) -> dict[str, Any]:
    heaviest = solve_max_initial_mass(draw.legs, method=protocol.solver)
    m_star = np.where(heaviest.converged, heaviest.m0, np.nan)
    near = m_star * np.exp(log_ratio)
    redrawn = chosen & (near >= draw.m0_min) & (near <= draw.m0_max)
    legs = _with_masses(draw.legs, np.where(redrawn, near, draw.legs.m0))
    return _flown_labels(legs, protocol, heaviest, redrawn)


def _margin_range_labels(
    draw: Draw, protocol: Protocol, log_margin: NDArray[np.float64]
) -> dict[str, Any]:
    """Label legs with masses that follow from m*, several of them for each leg drawn."""
    rows = np.arange(len(draw.legs))
    first = rows - rows % protocol.masses_per_leg
    some, again = np.unique(first, return_inverse=True)
    heaviest = solve_max_initial_mass(draw.legs.take(some), method=protocol.solver).take(again)
    seconds = np.where(rows == first, heaviest.seconds, 0.0)
    heaviest = replace(heaviest, seconds=seconds)
    m_star = np.where(heaviest.converged, heaviest.m0, draw.legs.m0[first])
    wanted = np.clip(m_star * np.exp(-log_margin), draw.m0_min[first], draw.m0_max[first])
    legs = _with_masses(draw.legs.take(first), wanted)
    return _flown_labels(legs, protocol, heaviest, np.ones(len(rows), dtype=np.bool_))


def _flown_labels(
    legs: Legs, protocol: Protocol, heaviest: LegSolutions, redrawn: NDArray[np.bool_]
) -> dict[str, Any]:
    """Return the columns of legs whose m* is known, with minimum propellant if wanted."""
    m_star = np.where(heaviest.converged, heaviest.m0, np.nan)
    log_margin = np.log(m_star / legs.m0)
    flyable = log_margin >= 0.0
    status = np.where(heaviest.converged, Status.TOO_HEAVY, Status.NOT_CONVERGED).astype(np.int8)
    status[flyable] = Status.CONVERGED
    m_final = np.full(len(legs), np.nan)
    seconds = heaviest.seconds.copy()
    if protocol.propellant:
        rows = np.flatnonzero(flyable)
        best = optimise(legs.take(rows), method=protocol.solver, guess=heaviest.take(rows))
        status[rows] = best.status
        m_final[rows] = np.where(best.converged, best.m_final, np.nan)
        seconds[rows] += best.seconds
    return {
        "legs": legs,
        "m_star_kg": m_star,
        "log_margin": log_margin,
        "m_final_kg": m_final,
        "status": status,
        "start": heaviest.start,
        "seconds": seconds,
        "boundary_draw": redrawn,
    }


def _with_masses(legs: Legs, m0: NDArray[np.float64]) -> Legs:
    """Return the legs with other initial masses.

    Where a mass is below a row's dry mass (drawn spacecraft), the dry mass keeps its ratio to
    the initial mass.
    """
    m_dry = np.where(m0 < legs.m_dry, legs.m_dry / legs.m0 * m0, legs.m_dry)
    return Legs(
        rv_dep=legs.rv_dep,
        rv_arr=legs.rv_arr,
        tof_days=legs.tof_days,
        m0=m0,
        thrust=legs.thrust,
        isp=legs.isp,
        m_dry=m_dry,
        t_dep_mjd2000=legs.t_dep_mjd2000,
        dep_id=legs.dep_id,
        arr_id=legs.arr_id,
    )


def _convergence_labels(draw: Draw, solver: str, rng: np.random.Generator) -> dict[str, Any]:
    """Label by one random start; m* is found too, to tell what luck adds to physics."""
    legs = draw.legs
    found = converge_from_random_start(legs, rng)
    heaviest = solve_max_initial_mass(legs, method=solver)
    m_star = np.where(heaviest.converged, heaviest.m0, np.nan)
    return {
        "legs": legs,
        "m_star_kg": m_star,
        "log_margin": np.log(m_star / legs.m0),
        "m_final_kg": np.where(found.converged, found.m_final, np.nan),
        "status": found.status,
        "start": found.start,
        "seconds": found.seconds,
        "boundary_draw": np.zeros(len(legs), dtype=np.bool_),
    }


def _leg_columns(legs: Legs, task: ShardTask) -> Columns:
    assert legs.dep_id is not None
    assert legs.arr_id is not None
    assert legs.t_dep_mjd2000 is not None
    # Drawn orbits get ids of their own, so that splits by pair keep them apart; rows of one leg
    # with several masses share them.
    row = np.arange(len(legs), dtype=np.int64)
    row += task.shard * task.protocol.legs_per_shard - row % task.protocol.masses_per_leg
    columns = {
        "dep_id": np.where(legs.dep_id == -1, -2 * row - 1, legs.dep_id),
        "arr_id": np.where(legs.arr_id == -1, -2 * row - 2, legs.arr_id),
        "t_dep_mjd2000": legs.t_dep_mjd2000,
        "tof_days": legs.tof_days,
        "m0_kg": legs.m0,
        "thrust_n": legs.thrust,
        "isp_s": legs.isp,
        "m_dry_kg": legs.m_dry,
    }
    for state, names in ((legs.rv_dep, DEPARTURE_STATE), (legs.rv_arr, ARRIVAL_STATE)):
        columns |= {column.name: state[:, k] for k, column in enumerate(names)}
    return columns
