"""Tours as tables: for a terminal, a notebook and pandas."""

import html
import math
from typing import TYPE_CHECKING, Any, Final

from feasibility.constants import MJD2000_MJD
from feasibility.errors import MissingDependencyError
from seqsearch.tours.dates import date_of
from seqsearch.tours.records import Vector

if TYPE_CHECKING:
    from seqsearch.tours.tour import Tour

_HEADER: Final = (
    f"{'leg':>3}  {'from':>7}  {'to':>7}  {'name':<14}  {'departure, MJD':<20}  "
    f"{'arrival':<10}  {'days':>7}  {'m0 kg':>8}  {'mf kg':>8}  {'margin':>6}"
)


def text_table(tour: "Tour") -> str:
    """Return the legs as a text table."""
    lines = [_HEADER, "-" * len(_HEADER)]
    lines += [
        f"{k:>3}  {leg.from_id:>7}  {leg.to_id:>7}  {tour.body(leg.to_id).name[:14]:<14}  "
        f"{date_of(leg.t_dep_mjd2000)} {leg.t_dep_mjd2000 + MJD2000_MJD:>9.2f}  "
        f"{date_of(leg.t_arr_mjd2000)}  "
        f"{leg.tof_days:>7.2f}  {leg.m0_kg:>8.2f}  {leg.m_final_kg:>8.2f}  {leg.margin:>6.3f}"
        for k, leg in enumerate(tour.legs, 1)
    ]
    return "\n".join(lines)


def rows(tour: "Tour") -> list[dict[str, Any]]:
    """Return the legs as records, one a leg, with units in the names."""
    return [
        {
            "leg": k,
            "from_id": leg.from_id,
            "to_id": leg.to_id,
            "to_name": tour.body(leg.to_id).name,
            "departure": date_of(leg.t_dep_mjd2000),
            "arrival": date_of(leg.t_arr_mjd2000),
            "t_dep_mjd2000": leg.t_dep_mjd2000,
            "tof_days": leg.tof_days,
            "m0_kg": leg.m0_kg,
            "m_final_kg": leg.m_final_kg,
            "m_star_kg": leg.m_star_kg,
            "margin": leg.margin,
            "dropped_kg": leg.dropped_kg,
            "fly_by": leg.is_fly_by,
            "dep_speed_m_s": _speed(leg.dep_velocity_m_s),
            "arr_speed_m_s": _speed(leg.arr_velocity_m_s),
        }
        for k, leg in enumerate(tour.legs, 1)
    ]


def _speed(velocity: Vector) -> float:
    return math.hypot(*velocity)


def html_table(tour: "Tour") -> str:
    """Return summary and legs as HTML, as notebooks show them."""
    columns = ("leg", "from_id", "to_id", "to_name", "departure", "arrival", "tof_days", "margin")
    head = "".join(f"<th>{name}</th>" for name in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{_cell(row[name])}</td>" for name in columns) + "</tr>"
        for row in rows(tour)
    )
    return f"<p>{html.escape(tour.summary())}</p><table><tr>{head}</tr>{body}</table>"


def dataframe(tour: "Tour") -> Any:
    """Return the legs as a `pandas.DataFrame`.

    Raises
    ------
    MissingDependencyError
        pandas is not installed.
    """
    try:
        import pandas as pd
    except ModuleNotFoundError:
        raise MissingDependencyError(
            "pandas is not installed, and to_dataframe needs it; pip install pandas"
        ) from None
    return pd.DataFrame(rows(tour))


def _cell(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) else html.escape(str(value))
