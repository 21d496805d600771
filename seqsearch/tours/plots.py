"""A picture of a tour: the path in the ecliptic, mass and throttle over time."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, DAY_S, MJD2000_MJD
from feasibility.runtime.atomic import atomic_path
from seqsearch.tours.motion import arrival_state, body_state, departure_state
from seqsearch.tours.records import TourLeg
from seqsearch.tours.tour import Tour

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POINTS_PER_ARC = 8


def plot_tour(tour: Tour, path: Path) -> None:
    """Draw a tour into a PNG or SVG file (by its suffix).

    Parameters
    ----------
    tour : Tour
        The tour.
    path : Path
        Where to write; replaced if it exists.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    # The object interface needs no display and leaves the caller's pyplot state alone.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 6), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=[1.2, 1])
    _draw_path(figure.add_subplot(grid[:, 0]), tour)
    _draw_mass(figure.add_subplot(grid[0, 1]), tour)
    _draw_throttle(figure.add_subplot(grid[1, 1]), tour)
    figure.suptitle(f"{tour.rules.name}: {tour.summary()}", fontsize=10)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format=path.suffix.lstrip(".") or "png", dpi=130)


def _draw_path(axes: "Axes", tour: Tour) -> None:
    for leg in tour.legs:
        track = _track(tour, leg) / AU
        axes.plot(track[:, 0], track[:, 1], linewidth=1.2)
    for k, (x, y) in enumerate(_stops(tour)):
        axes.plot(x, y, "ko", markersize=3)
        axes.annotate(str(k), (x, y), xytext=(4, 4), textcoords="offset points", fontsize=7)
    axes.plot(0, 0, "o", color="gold", markeredgecolor="k")
    axes.set(aspect="equal", xlabel="x, AU (ecliptic J2000)", ylabel="y, AU")
    axes.set_title("visits in order, 0 is the start", fontsize=9)


def _stops(tour: Tour) -> NDArray[np.float64]:
    """Return (s, 2) where the tour stops in the ecliptic, in AU."""
    mu = tour.rules.mu_m3_s2
    if not tour.legs:
        states = [body_state(body, tour.t_start_mjd2000, mu) for body in tour.bodies[:1]]
    else:
        first = tour.legs[0]
        states = [departure_state(first, tour.body(first.from_id), mu)]
        states += [
            arrival_state(leg, tour.body(leg.to_id), mu) for leg in tour.legs if not leg.is_fly_by
        ]
    return np.array(states).reshape(-1, 6)[:, :2] / AU


def _draw_mass(axes: "Axes", tour: Tour) -> None:
    for leg in tour.legs:
        epochs = [leg.t_dep_mjd2000, *(i.t_mjd2000 for i in leg.impulses), leg.t_arr_mjd2000]
        masses = [leg.m0_kg, *(i.mass_after_kg for i in leg.impulses), leg.m_final_kg]
        axes.step(np.asarray(epochs) + MJD2000_MJD, masses, where="post", color="C0")
    axes.axhline(tour.rules.m_dry_kg, color="C3", linestyle="--", linewidth=1, label="dry mass")
    axes.set(ylabel="mass, kg")
    axes.legend(fontsize=8)


def _draw_throttle(axes: "Axes", tour: Tour) -> None:
    for leg in tour.legs:
        edges = np.linspace(leg.t_dep_mjd2000, leg.t_arr_mjd2000, len(leg.impulses) + 1)
        norms = [float(np.linalg.norm(impulse.throttle)) for impulse in leg.impulses]
        axes.stairs(norms, edges + MJD2000_MJD, fill=True, color="C1")
    axes.set(xlabel="MJD", ylabel="throttle", ylim=(0, 1.05))


def _track(tour: Tour, leg: TourLeg) -> NDArray[np.float64]:
    """Return (p, 3) points in m along a leg, on the Kepler arcs between its impulses."""
    from feasibility.orbits.kepler_kernels import propagate_batch

    mu = tour.rules.mu_m3_s2
    state = departure_state(leg, tour.body(leg.from_id), mu)
    state[3:] += leg.dep_velocity_m_s
    epochs = [leg.t_dep_mjd2000, *(i.t_mjd2000 for i in leg.impulses), leg.t_arr_mjd2000]
    impulses = [*(np.asarray(impulse.dv_m_s) for impulse in leg.impulses), np.zeros(3)]
    points = []
    for begin, end, impulse in zip(epochs[:-1], epochs[1:], impulses, strict=True):
        dt_s = np.linspace(0.0, (end - begin) * DAY_S, _POINTS_PER_ARC)
        arc = propagate_batch(np.repeat(state[None], _POINTS_PER_ARC, axis=0), dt_s, mu)
        points.append(arc[:, :3])
        state = arc[-1].copy()
        state[3:] += impulse
    return np.concatenate(points)
