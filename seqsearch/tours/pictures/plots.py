"""Pictures of a tour: its path in the ecliptic, its visits, thrust and mass over time.

`plot_tour` writes them together into a file. The others draw into axes of your own. The numbers
in all of them are those of the table of legs, 0 for the start.
"""

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from feasibility.constants import AU
from feasibility.runtime.atomic import atomic_path
from seqsearch.tours.bodies.told_motion import motion_of
from seqsearch.tours.dates import date_of
from seqsearch.tours.paths import impulsive_trajectory, orbit_points
from seqsearch.tours.pictures.stops import stops
from seqsearch.tours.tour import Tour

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MPL_MJD2000: Final = 10957.0
"""Days from matplotlib's zero, 1970-01-01, to that of MJD2000."""

_BLUE, _ORANGE, _GREEN, _GREY = "#0072b2", "#e69f00", "#009e73", "#767676"
"""Of Okabe and Ito's palette, which the colour-blind tell apart."""

_CROWDED: Final = 0.06
"""Stops whose distance is less than this share of that from the Sun share a place."""

_LONGEST_NAME: Final = 20
_STYLE: Final[dict[Any, Any]] = {
    "font.size": 8.0,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "pdf.fonttype": 42,
    "svg.hashsalt": "seqsearch",
}


def plot_tour(tour: Tour, path: Path | str) -> None:
    """Draw a tour into a PNG, SVG or PDF file (by its suffix).

    Parameters
    ----------
    tour : Tour
        The tour.
    path : Path or str
        Where to write; replaced if it exists.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    # The object interface needs no display and leaves the caller's pyplot state alone.
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    path = Path(path)
    kind = path.suffix.lstrip(".") or "png"
    with rc_context(_STYLE), warnings.catch_warnings():
        # A name may have characters that no font of this machine has; a box stands for them.
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        rows = len(tour.legs)
        figure = Figure(figsize=(11.0, max(6.0, 4.0 + 0.17 * rows)), layout="constrained")
        heights = [max(1.0, 0.14 * rows), 0.9, 0.9]
        grid = figure.add_gridspec(3, 2, width_ratios=[1.15, 1.0], height_ratios=heights)
        plot_path(tour, figure.add_subplot(grid[:, 0]))
        timeline = figure.add_subplot(grid[0, 1])
        plot_timeline(tour, timeline)
        plot_thrust(tour, figure.add_subplot(grid[1, 1], sharex=timeline))
        plot_mass(tour, figure.add_subplot(grid[2, 1], sharex=timeline))
        figure.suptitle(_plain(f"{tour.rules.name}: {tour.summary()}"), fontsize=9.5)
        with atomic_path(path) as temporary:
            # Without a date the same tour gives the same file.
            metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
            figure.savefig(temporary, format=kind, dpi=160, metadata=metadata)


def plot_path(tour: Tour, axes: "Axes") -> None:
    """Draw the path in the ecliptic, the orbits of the bodies and the stays.

    Parameters
    ----------
    tour : Tour
        The tour.
    axes : matplotlib.axes.Axes
        Where to draw.
    """
    from matplotlib import colormaps

    for body in {body.id: body for body in tour.bodies}.values():
        orbit = orbit_points(body) / AU
        axes.plot(orbit[:, 0], orbit[:, 1], color=_GREY, linewidth=0.4, alpha=0.6, zorder=1)
    phases = impulsive_trajectory(tour).phases if tour.legs else ()
    for k, phase in enumerate(phases):
        # The bright end of viridis is left out, as it is hard to see on white.
        colour = colormaps["viridis"](0.86 * k / max(1, len(phases) - 1))
        track = phase.states[:, :2] / AU
        axes.plot(track[:, 0], track[:, 1], color=colour, linewidth=1.7, zorder=2)
    marked: list[tuple[float, float]] = []
    for stop in stops(tour):
        x, y = (motion_of(tour, stop.body, [stop.t_mjd2000])[0, :2] / AU).tolist()
        axes.plot(x, y, "o", color="black", markersize=2.8, zorder=4)
        radius = max(float(np.hypot(x, y)), 1e-9)
        # Where an earlier number stands already, the later one stands further out.
        crowd = sum(np.hypot(x - a, y - b) < _CROWDED * radius for a, b in marked)
        marked.append((x, y))
        outwards = (9.0 + 10.0 * crowd) / radius
        axes.annotate(
            str(stop.number), (x, y), xytext=(outwards * x, outwards * y),
            textcoords="offset points", ha="center", va="center", fontsize=8,
            fontweight="bold", zorder=5,
        )  # fmt: skip
        if stop.stay_days:
            days = np.linspace(0.0, stop.stay_days, 12)
            stay = motion_of(tour, stop.body, stop.t_mjd2000 + days)[:, :2] / AU
            axes.plot(stay[:, 0], stay[:, 1], color=_ORANGE, linewidth=2.6, zorder=3)
    axes.plot(0, 0, "o", color=_ORANGE, markeredgecolor="black", markeredgewidth=0.5)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x, AU (ecliptic J2000)", ylabel="y, AU")


def plot_timeline(tour: Tour, axes: "Axes") -> None:
    """Draw when the legs fly and how long the stays are, with names and dates of arrival.

    Parameters
    ----------
    tour, axes
        As for `plot_path`.
    """
    marked = stops(tour)
    for leg, stop in zip(tour.legs, marked[1:], strict=True):
        begin = leg.t_dep_mjd2000 + _MPL_MJD2000
        axes.barh(stop.number, leg.tof_days, left=begin, height=0.62, color=_BLUE)
        if stop.fly_by:
            axes.plot(begin + leg.tof_days, stop.number, "D", color="black", markersize=3)
        elif stop.stay_days:
            axes.barh(
                stop.number, stop.stay_days, left=begin + leg.tof_days, height=0.62,
                color=_ORANGE, hatch="////", edgecolor="white", linewidth=0.0,
            )  # fmt: skip
    labels = [
        f"{stop.number}  {_short(stop.body.name or str(stop.body.id))}  {date_of(stop.t_mjd2000)}"
        for stop in marked
    ]
    axes.set_yticks([stop.number for stop in marked], labels)
    axes.set_ylim(len(tour.legs) + 0.6, -0.6)
    axes.set_title("start and arrivals; flights blue, stays orange", fontsize=8, loc="left")
    _dates(axes)


def plot_thrust(tour: Tour, axes: "Axes") -> None:
    """Draw the thrust over time, segment by segment.

    Parameters
    ----------
    tour, axes
        As for `plot_path`.
    """
    for leg in tour.legs:
        edges = np.linspace(leg.t_dep_mjd2000, leg.t_arr_mjd2000, len(leg.impulses) + 1)
        force = [
            tour.rules.thrust_n * float(np.linalg.norm(impulse.throttle))
            for impulse in leg.impulses
        ]
        axes.stairs(force, edges + _MPL_MJD2000, fill=True, color=_BLUE, alpha=0.35)
        axes.stairs(force, edges + _MPL_MJD2000, color=_BLUE, linewidth=0.8)
    axes.axhline(tour.rules.thrust_n, color=_GREY, linestyle="--", linewidth=0.8)
    axes.set(ylabel="thrust, N", ylim=(0.0, 1.1 * tour.rules.thrust_n))
    _dates(axes)


def plot_mass(tour: Tour, axes: "Axes") -> None:
    """Draw the mass over time, what is left behind included.

    Parameters
    ----------
    tour, axes
        As for `plot_path`.
    """
    epochs: list[float] = []
    masses: list[float] = []
    for leg in tour.legs:
        times = [impulse.t_mjd2000 for impulse in leg.impulses]
        epochs += [leg.t_dep_mjd2000, *times, leg.t_arr_mjd2000, leg.t_arr_mjd2000]
        masses += [leg.m0_kg, *(impulse.mass_after_kg for impulse in leg.impulses)]
        masses += [leg.m_final_kg, leg.m_final_kg - leg.dropped_kg]
    dates = [t + _MPL_MJD2000 for t in epochs]
    axes.step(dates, masses, where="post", color=_GREEN, linewidth=1.2)
    axes.axhline(tour.rules.m_dry_kg, color=_GREY, linestyle="--", linewidth=0.8)
    axes.annotate(
        "dry mass", (1.0, tour.rules.m_dry_kg), xycoords=("axes fraction", "data"),
        xytext=(0, 2), textcoords="offset points", ha="right", va="bottom", fontsize=7,
    )  # fmt: skip
    axes.set(ylabel="mass, kg", xlabel="date (TDB)")
    _dates(axes)


def _dates(axes: "Axes") -> None:
    """Label the axis of time with calendar dates."""
    from matplotlib import dates

    untyped: Any = dates
    locator = untyped.AutoDateLocator(minticks=4, maxticks=9)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(untyped.ConciseDateFormatter(locator))


def _short(name: str) -> str:
    shown = name if len(name) <= _LONGEST_NAME else name[: _LONGEST_NAME - 1] + "…"
    return _plain(shown)


def _plain(text: str) -> str:
    """Return a text that matplotlib takes as it is: a pair of $ would begin a formula."""
    return "".join(c if c.isprintable() else " " for c in text).replace("$", r"\$")
