"""``json``: bodies, legs and rows as one JSON document, with a published schema.

The schema is ``flight.schema.json`` beside this file; `schema` returns it.
"""

import json
from importlib import resources
from pathlib import Path
from typing import Any, Final, final

import numpy as np

from feasibility.constants import AU, MJD2000_MJD
from feasibility.runtime.atomic import write_text
from seqsearch.tours.dates import date_of
from seqsearch.tours.export.arcs import Arc, mission_arcs, words
from seqsearch.tours.export.as_flown import as_flown
from seqsearch.tours.export.protocol import Flight
from seqsearch.tours.records import TourBody, Vector

FORMAT: Final = "seqsearch-flight-1"
"""Name and version of the layout."""

COLUMNS: Final = (
    "t_mjd_tdb", "x_km", "y_km", "z_km", "vx_km_s", "vy_km_s", "vz_km_s",
    "m_kg", "thrust_x_n", "thrust_y_n", "thrust_z_n",
)  # fmt: skip
"""Names of a row's numbers, in order."""


@final
class JsonExporter:
    """Writes what the schema describes; numbers come back exactly as they were."""

    name = "json"

    def write(self, flight: Flight, path: Path, /) -> None:
        """Write the document.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        write_text(path, json.dumps(document(flight), allow_nan=False, indent=None) + "\n")


def schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of the documents."""
    text = resources.files(__package__).joinpath("flight.schema.json")
    record: dict[str, Any] = json.loads(text.read_text(encoding="utf-8"))
    return record


def document(flight: Flight) -> dict[str, Any]:
    """Return a flight as plain data.

    Raises
    ------
    InputError
        The trajectory has another number of phases than the tour has legs.
    """
    tour = as_flown(flight)
    arcs = mission_arcs(flight)
    return {
        "format": FORMAT,
        "comment": words(flight),
        "frame": "heliocentric ecliptic J2000",
        "time_system": "TDB",
        "model": "continuous" if flight.trajectory.continuous else "impulsive",
        "problem": tour.rules.name,
        "mu_km3_s2": tour.rules.mu_m3_s2 / 1e9,
        "score": tour.score,
        "bodies": [_body(body) for body in tour.bodies],
        "legs": [
            {
                "leg": number,
                "from_id": leg.from_id,
                "to_id": leg.to_id,
                "departure_mjd_tdb": leg.t_dep_mjd2000 + MJD2000_MJD,
                "departure_date": date_of(leg.t_dep_mjd2000),
                "tof_days": leg.tof_days,
                "m0_kg": leg.m0_kg,
                "m_final_kg": leg.m_final_kg,
                "margin": leg.margin,
                "fly_by": leg.is_fly_by,
                "departure_excess_km_s": _km_s(leg.dep_velocity_m_s),
                "arrival_excess_km_s": _km_s(leg.arr_velocity_m_s),
            }
            for number, leg in enumerate(tour.legs, 1)
        ],
        "columns": list(COLUMNS),
        "arcs": [_arc(arc) for arc in arcs],
    }


def _km_s(velocity_m_s: Vector) -> list[float]:
    return [component / 1e3 for component in velocity_m_s]


def _body(body: TourBody) -> dict[str, Any]:
    return {
        "id": body.id,
        "name": body.name,
        "epoch_mjd_tdb": body.epoch_mjd2000 + MJD2000_MJD,
        "a_au": body.a_m / AU,
        "e": body.e,
        "i_deg": float(np.degrees(body.i_rad)),
        "node_deg": float(np.degrees(body.node_rad)),
        "argp_deg": float(np.degrees(body.argp_rad)),
        "m_deg": float(np.degrees(body.mean_anomaly_rad)),
    }


def _arc(arc: Arc) -> dict[str, Any]:
    rows = np.column_stack(
        [arc.t_mjd2000 + MJD2000_MJD, arc.states / 1e3, arc.mass_kg, arc.thrust_n]
    )
    return {
        "label": arc.label,
        "kind": "stay" if arc.stay else "flight",
        "leg": arc.number,
        "rows": rows.tolist(),
    }
