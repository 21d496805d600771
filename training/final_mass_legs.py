"""The legs from which the net for final masses learns, and fresh ones to judge it.

All can be flown: initial masses follow from m*, and each leg has several of them. The families
are wider than those for the margins: launches from the Earth, returns, transfers to Mars,
flights of up to four turns, and spacecraft up to 60 times lighter than m*. Families whose names
begin with "free-" are those of the margins with free ends.
"""

from pathlib import Path
from typing import Any, Final

import msgspec

from feasibility.dataset import read_protocol
from feasibility.dataset.protocol import Protocol
from feasibility.dataset.samplers.transfers import Transfers

SEED, FRESH_SEED = 13, 7003
TEST_LEGS: Final = 800

LEGS: Final = {
    "search": 48_000,
    "table1": 32_000,
    "nea": 32_000,
    "general": 42_000,
    "planets": 14_000,
    "launch-nea": 30_000,
    "return-nea": 30_000,
    "launch-belt": 14_000,
    "return-belt": 14_000,
    "nea-nea": 38_000,
    "belt-belt": 28_000,
    "free-launch": 28_000,
    "free-arrival": 24_000,
    "free-launch-flyby": 24_000,
    "free-flyby": 28_000,
}
"""Family: rows to learn from, in fours that share a leg."""

TESTS: Final = {
    "search": ("search", (1.0, 8.0), {}),
    "table1": ("table1", (1.0, 8.0), {}),
    "nea": ("nea", (1.0, 8.0), {}),
    "earth-mars": ("planets", (1.0, 4.0), {"revolutions": (0.3, 2.0), "tof_days": (200.0, 900.0)}),
    "launch-nea": ("launch-nea", (1.0, 4.0), {"revolutions": (0.3, 2.0)}),
    "launch-belt": ("launch-belt", (1.0, 4.0), {"revolutions": (0.3, 2.0)}),
    "return-nea": ("return-nea", (1.0, 4.0), {"revolutions": (0.3, 2.0)}),
    "return-belt": ("return-belt", (1.0, 4.0), {"revolutions": (0.3, 2.0)}),
    "turns-nea": ("nea-nea", (1.0, 4.0), {"revolutions": (1.0, 4.0)}),
    "turns-belt": ("belt-belt", (1.0, 4.0), {"revolutions": (1.0, 4.0)}),
    "light-nea": ("nea-nea", (2.0, 60.0), {"revolutions": (0.3, 2.0)}),
    "light-belt": ("belt-belt", (2.0, 60.0), {"revolutions": (0.3, 2.0)}),
    "free-launch": ("free-launch", (1.0, 8.0), {}),
    "free-arrival": ("free-arrival", (1.0, 8.0), {}),
    "free-launch-flyby": ("free-launch-flyby", (1.0, 8.0), {}),
    "free-flyby": ("free-flyby", (1.0, 8.0), {}),
}
"""Fresh family: family like which its legs are drawn, range of m*/m0, and what differs."""

_ENDS: Final = {
    "planets": (("earth", "mars"), ("mars", "earth")),
    "launch": (("earth",), ("catalogue",)),
    "return": (("catalogue",), ("earth",)),
    "nea": (("catalogue",), ("catalogue",)),
    "belt": (("catalogue",), ("catalogue",)),
}
_ISP: Final = (1500.0, 5000.0)
_MASSES_PER_LEG: Final = 4
_LEGS_PER_SHARD: Final = 1000
_LIGHTEST: Final = {"search": 8.0, "table1": 30.0, "nea": 30.0}
_FREE: Final = "free-"
_MOST: Final = 60.0


def final_mass_protocol(family: str, tables: Path) -> Protocol:
    """Return the protocol of a family of `LEGS`.

    Parameters
    ----------
    family : str
        Its name.
    tables : Path
        Folder of the official tables.
    """
    near_earth = family.endswith("nea") or family in ("planets",)
    table = str(tables / ("GTOC5-DATA.txt" if near_earth else "GTOC7-DATA.txt"))
    changes: dict[str, Any] = {
        "name": f"final-mass-{family}",
        "boundary_share": 0.0,
        "margin_range": (1.0, _LIGHTEST.get(family, _MOST)),
        "masses_per_leg": _MASSES_PER_LEG,
        "legs_per_shard": _LEGS_PER_SHARD,
    }
    if family in ("search", "table1", "nea"):
        made = read_protocol("limited" if family == "nea" else family).with_catalogue(table)
        assert made.spacecraft is not None
        # Masses follow from m*; these bounds only keep the acceleration below 0.01 m/s2.
        sampler = msgspec.structs.replace(made.sampler, m0_kg=(31.0, 1e6))
        craft = msgspec.structs.replace(made.spacecraft, dry_mass_kg=0.0)
        return msgspec.structs.replace(made, **changes, sampler=sampler, spacecraft=craft)
    if family == "general" or family.startswith(_FREE):
        made = read_protocol(family.removeprefix(_FREE)).with_catalogue(table)
        # Masses follow from m*, as far as these bounds let them; without thrust from the least.
        sampler = msgspec.structs.replace(
            made.sampler,
            acceleration_m_s2=(1e-6, 9e-3),
            m0_kg=(100.0, 1000.0),
            dry_share=(1e-9, 1e-9),
        )
        if family == "general":
            sampler = msgspec.structs.replace(sampler, revolutions=(0.05, 4.0))
        return msgspec.structs.replace(made, **changes, sampler=sampler)
    departures, arrivals = _ENDS[family.split("-")[0]]
    sampler = Transfers(
        departures=departures, arrivals=arrivals, revolutions=(0.2, 4.0), isp_s=_ISP
    )
    return Protocol(sampler=sampler, **changes).with_catalogue(table)


def fresh_protocol(test: str, tables: Path) -> Protocol:
    """Return the protocol of a family of `TESTS`: each row is a leg of its own."""
    family, margins, changes = TESTS[test]
    made = final_mass_protocol(family, tables)
    return msgspec.structs.replace(
        made,
        name=f"fresh-{test}",
        sampler=msgspec.structs.replace(made.sampler, **changes),
        margin_range=margins,
        masses_per_leg=1,
    )
