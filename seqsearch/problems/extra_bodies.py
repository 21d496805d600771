"""Bodies that a problem file adds to its asteroid table: ``[[bodies]]``."""

from collections.abc import Sequence
from typing import Final, final

import msgspec
import numpy as np

from feasibility import InputError
from feasibility.constants import AU, mjd_to_mjd2000
from feasibility.orbits import Catalogue, earth

_ELEMENTS: Final = ("a_au", "e", "i_deg", "node_deg", "argp_deg", "mean_anomaly_deg", "epoch_mjd")


@final
class BodyTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One table ``[[bodies]]``: osculating elements, or the Earth as GTOC defines it.

    It does not count unless it is `scored`: tours start and end there.
    """

    name: str
    id: int
    earth: bool = False
    scored: bool = False
    a_au: float | None = None
    e: float | None = None
    i_deg: float | None = None
    node_deg: float | None = None
    argp_deg: float | None = None
    mean_anomaly_deg: float | None = None
    epoch_mjd: float | None = None


def extra_bodies(tables: Sequence[BodyTable], problem: str) -> Catalogue:
    """Return the bodies of some tables, at least one.

    Raises
    ------
    InputError
        An element is missing, or given for the Earth; an orbit is no ellipse; an id comes twice.
    """
    rows = [
        _row(table, f"problem {problem}: body {table.name!r} of [[bodies]]") for table in tables
    ]
    return Catalogue(
        ids=[table.id for table in tables],
        names=[table.name for table in tables],
        epoch_mjd2000=[epoch for epoch, _ in rows],
        elements=np.array([elements for _, elements in rows]),
        source=f"[[bodies]] of problem {problem}",
    )


def _row(table: BodyTable, label: str) -> tuple[float, list[float]]:
    """Return epoch and elements of a body, in SI units."""
    values = {name: getattr(table, name) for name in _ELEMENTS}
    given = [name for name, value in values.items() if value is not None]
    if table.earth:
        if given:
            raise InputError(f"{label}: earth = true and {given[0]}, expected one of them")
        planet = earth()
        return float(planet.epoch_mjd2000[0]), planet.elements[0].tolist()
    missing = [name for name in _ELEMENTS if name not in given]
    if missing:
        raise InputError(f"{label}: no {missing[0]}, expected all of {', '.join(_ELEMENTS)}")
    a, e, *angles, epoch = (values[name] for name in _ELEMENTS)
    return mjd_to_mjd2000(epoch), [a * AU, e, *np.radians(angles).tolist()]
