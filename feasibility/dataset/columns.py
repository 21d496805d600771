"""The columns of a dataset: names, types, units and meanings."""

from dataclasses import dataclass
from typing import Final, final


@final
@dataclass(frozen=True)
class Column:
    """One column of a dataset."""

    name: str
    dtype: str
    unit: str
    meaning: str


def _state(end: str, where: str) -> tuple[Column, ...]:
    return tuple(
        Column(
            f"{quantity}{axis}_{end}_{unit.replace('/', '_')}",
            "float64",
            unit,
            f"{name}, {axis}, of the {where}, heliocentric J2000 ecliptic",
        )
        for quantity, unit, name in (("r", "m", "position"), ("v", "m/s", "velocity"))
        for axis in "xyz"
    )


DEPARTURE_STATE: Final = _state("dep", "departure body at departure")
ARRIVAL_STATE: Final = _state("arr", "arrival body at arrival")

COLUMNS: Final = (
    Column("dep_id", "int64", "", "id of the departure body; negative for a drawn orbit"),
    Column("arr_id", "int64", "", "id of the arrival body; negative for a drawn orbit"),
    Column("t_dep_mjd2000", "float64", "d", "departure epoch, days since 2000-01-01 00:00"),
    Column("tof_days", "float64", "d", "time of flight"),
    *DEPARTURE_STATE,
    *ARRIVAL_STATE,
    Column("m0_kg", "float64", "kg", "initial mass"),
    Column("thrust_n", "float64", "N", "maximum thrust"),
    Column("isp_s", "float64", "s", "specific impulse"),
    Column("m_dry_kg", "float64", "kg", "dry mass"),
    Column(
        "dt_imp_days",
        "float64",
        "d",
        "flight time of the cheapest impulsive transfer from the same epoch; NaN where not asked",
    ),
    Column(
        "lambert_dv_m_s",
        "float64",
        "m/s",
        "velocity change of the best Lambert branch in tof_days beyond the excess velocities; "
        "NaN where there is none",
    ),
    Column(
        "m_star_kg",
        "float64",
        "kg",
        "maximum initial mass; inf where no thrust is needed, NaN where not found or not asked",
    ),
    Column("log_margin", "float64", "", "log(m_star_kg / m0_kg); the leg is flyable where >= 0"),
    Column(
        "m_final_kg",
        "float64",
        "kg",
        "largest final mass at m0_kg (minimum propellant); NaN where not flyable or not asked",
    ),
    Column(
        "status",
        "int8",
        "",
        "0 flyable, 1 a solver found nothing, 2 flyable but below the dry mass, 3 too heavy",
    ),
    Column("start", "int16", "", "which start of the solver won, -1 where none"),
    Column("seconds", "float64", "s", "processor time of the solvers"),
    Column("boundary_draw", "bool", "", "whether m0_kg was drawn again near m_star_kg"),
    Column("vinf_dep_m_s", "float64", "m/s", "largest excess velocity at departure; may be inf"),
    Column("vinf_arr_m_s", "float64", "m/s", "largest excess velocity at arrival; may be inf"),
)
"""All columns, in the order of the files."""

ADDED: Final = ("vinf_dep_m_s", "vinf_arr_m_s")
"""The last columns: files of older versions have none of them, which means zeros."""
