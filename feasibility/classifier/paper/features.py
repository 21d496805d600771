"""The paper's 103 features of a leg (its Table 2), with names, units and groups."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import DAY_S, MU_SUN
from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.orbits import cartesian_to_classical, cartesian_to_equinoctial
from feasibility.orbits.lambert import lambert_delta_v

FEATURE_SET: Final = "paper-103"
"""Name of this set of features in artefacts."""

LAMBERT_REVOLUTIONS: Final = 2
"""Revolutions of the Lambert branches compared for the feature ``lambert_dv``."""

IMPULSIVE_REVOLUTIONS: Final = 1
"""Revolutions of the Lambert branches compared for the feature ``dt_imp``."""

NO_ARC_DELTA_V: Final = 1e5
"""m/s: value of ``lambert_dv`` where no Lambert arc exists; beyond any arc between asteroids."""

_GRID_DAYS: Final = (60.0, 1460.0, 10.0, 1.0)
"""First, last, coarse and fine step of the flight times for dt_imp (Table 1: 60 to 4 * 365)."""

_TWO_PI: Final = 2.0 * np.pi


@final
@dataclass(frozen=True)
class Feature:
    """One input of a model: its name, unit and the group of Table 2 it belongs to."""

    name: str
    unit: str
    group: str


_PER_BODY: Final = (
    Feature("a", "m", "classical elements"),
    Feature("e", "", "classical elements"),
    Feature("i", "rad", "classical elements"),
    Feature("node", "rad", "classical elements"),
    Feature("argp", "rad", "classical elements"),
    Feature("mean_anomaly", "rad", "classical elements"),
    Feature("p", "m", "modified equinoctial elements"),
    Feature("f", "", "modified equinoctial elements"),
    Feature("g", "", "modified equinoctial elements"),
    Feature("h", "", "modified equinoctial elements"),
    Feature("k", "", "modified equinoctial elements"),
    Feature("true_longitude", "rad", "modified equinoctial elements"),
    Feature("x", "m", "Cartesian position and velocity"),
    Feature("y", "m", "Cartesian position and velocity"),
    Feature("z", "m", "Cartesian position and velocity"),
    Feature("vx", "m/s", "Cartesian position and velocity"),
    Feature("vy", "m/s", "Cartesian position and velocity"),
    Feature("vz", "m/s", "Cartesian position and velocity"),
    Feature("spherical_radius", "m", "spherical position and velocity"),
    Feature("spherical_longitude", "rad", "spherical position and velocity"),
    Feature("spherical_latitude", "rad", "spherical position and velocity"),
    Feature("spherical_v_radial", "m/s", "spherical position and velocity"),
    Feature("spherical_v_longitude", "m/s", "spherical position and velocity"),
    Feature("spherical_v_latitude", "m/s", "spherical position and velocity"),
    Feature("cylindrical_radius", "m", "cylindrical position and velocity"),
    Feature("cylindrical_longitude", "rad", "cylindrical position and velocity"),
    Feature("cylindrical_z", "m", "cylindrical position and velocity"),
    Feature("cylindrical_v_radial", "m/s", "cylindrical position and velocity"),
    Feature("cylindrical_v_longitude", "m/s", "cylindrical position and velocity"),
    Feature("cylindrical_vz", "m/s", "cylindrical position and velocity"),
    Feature("sun_distance", "m", "distance from the Sun"),
    Feature("energy", "J/kg", "specific orbital energy"),
    Feature("momentum", "m2/s", "specific angular momentum"),
)

FEATURES: Final = (
    Feature("m0", "kg", "initial mass"),
    Feature("tof", "d", "time of flight"),
    *(
        Feature(f"{end}_{feature.name}", feature.unit, feature.group)
        for end in ("dep", "arr", "diff")
        for feature in _PER_BODY
    ),
    Feature("dt_imp", "d", "impulsive time of flight"),
    Feature("lambert_dv", "m/s", "Lambert velocity change"),
)
"""The columns of `paper_features`; ``diff`` is departure minus arrival, angles included."""


def paper_features(
    legs: Legs,
    *,
    dt_imp_days: ArrayLike | None = None,
    lambert_dv: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """Return the features of Table 2 of the paper.

    Parameters
    ----------
    legs : Legs
        n legs.
    dt_imp_days : array_like, optional
        (n,) days: flight time of the cheapest impulsive transfer; found by
        `impulsive_time_of_flight` where not given or NaN.
    lambert_dv : array_like, optional
        (n,) m/s: velocity change of the best Lambert branch in the given time of
        flight, both impulses; found where not given. NaN or inf says that no arc exists.

    Returns
    -------
    (n, 103) float64
        Columns as in `FEATURES`, all finite.

    Raises
    ------
    InputError
        A body is not on an ellipse: classical elements describe bound orbits only.
    """
    n = len(legs)
    dep, arr = body_features(legs.rv_dep), body_features(legs.rv_arr)
    if lambert_dv is None:
        lambert_dv = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s, LAMBERT_REVOLUTIONS)
    delta_v = np.array(lambert_dv, dtype=np.float64)
    impulsive = np.full(n, np.nan) if dt_imp_days is None else np.array(dt_imp_days, dtype=float)
    for name, column in (("dt_imp_days", impulsive), ("lambert_dv", delta_v)):
        if column.shape != (n,):
            raise InputError(f"paper_features {name}: shape {column.shape}, expected ({n},)")
    delta_v[~np.isfinite(delta_v)] = NO_ARC_DELTA_V
    unknown = np.flatnonzero(np.isnan(impulsive))
    if len(unknown):
        impulsive[unknown] = impulsive_time_of_flight(legs.take(unknown))
    return np.column_stack([legs.m0, legs.tof_days, dep, arr, dep - arr, impulsive, delta_v])


def body_features(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the features of one body, in the order of Table 2.

    Parameters
    ----------
    states : (n, 6) float64, m and m/s
        Heliocentric states.

    Returns
    -------
    (n, 33) float64
        Longitudes in [0, 2 pi); velocities along the unit vectors of each frame.

    Raises
    ------
    InputError
        A state is not on an ellipse.
    """
    x, y, z, vx, vy, vz = states.T
    rho = np.hypot(x, y)
    radius = np.hypot(rho, z)
    longitude = np.arctan2(y, x) % _TWO_PI
    # On the polar axis the longitude is 0 by convention, and so are its unit vectors.
    safe = np.where(rho > 0.0, rho, 1.0)
    cos_lon = np.where(rho > 0.0, x / safe, 1.0)
    sin_lon = np.where(rho > 0.0, y / safe, 0.0)
    v_rho = vx * cos_lon + vy * sin_lon
    v_lon = vy * cos_lon - vx * sin_lon
    v_radial = (rho * v_rho + z * vz) / radius
    v_latitude = (rho * vz - z * v_rho) / radius
    energy = 0.5 * (vx**2 + vy**2 + vz**2) - MU_SUN / radius
    momentum = np.linalg.norm(np.cross(states[:, :3], states[:, 3:]), axis=1)
    return np.column_stack(
        [
            cartesian_to_classical(states),
            cartesian_to_equinoctial(states),
            states,
            radius,
            longitude,
            np.arctan2(z, rho),
            v_radial,
            v_lon,
            v_latitude,
            rho,
            longitude,
            z,
            v_rho,
            v_lon,
            vz,
            radius,
            energy,
            momentum,
        ]
    )


def impulsive_time_of_flight(legs: Legs) -> NDArray[np.float64]:
    """Return dt_imp of Table 1: the flight time whose Lambert transfer is cheapest.

    The departure epoch and state are the leg's; the arrival body moves along
    its orbit (Kepler). Flight times run over [60, 4 * 365] days in steps of 10
    days, then of 1 day around the best; branches up to one revolution.

    Parameters
    ----------
    legs : Legs
        n legs. Those from the same state to the same body (`arr_id`, not
        negative) have the same answer, which is found once.

    Returns
    -------
    (n,) float64
        Days, on the fine grid; the shortest where several are equally good.
    """
    from feasibility.orbits.impulsive_kernels import cheapest_tof_batch

    if legs.arr_id is not None and (legs.arr_id >= 0).all():
        # A search proposes each pair with many flight times.
        key = np.column_stack([legs.rv_dep, legs.arr_id])
        _, some, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
        which = which.reshape(-1)
    else:
        some = which = np.arange(len(legs))
    legs = legs.take(some)
    first, last, coarse, fine = _GRID_DAYS
    best: NDArray[np.float64] = cheapest_tof_batch(
        # Copies are writable, as other callers' arrays are: one compiled version serves all.
        legs.rv_dep.copy(),
        legs.rv_arr.copy(),
        legs.tof_s,
        first * DAY_S,
        last * DAY_S,
        coarse * DAY_S,
        fine * DAY_S,
        IMPULSIVE_REVOLUTIONS,
        MU_SUN,
    )
    days: NDArray[np.float64] = best[which] / DAY_S
    return days
