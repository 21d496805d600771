"""What a problem asks of a given tour, without trusting the tour's own file."""

from pathlib import Path

import msgspec
import numpy as np

from feasibility.orbits import Catalogue
from feasibility.orbits.spk.files import kernel_files
from seqsearch.problems.problem_file import Config, build_problem
from seqsearch.tours.records import KernelFile, TourBody
from seqsearch.tours.tour import Tour, TourRules


def rules_of(config: Config, tour: Tour, catalogue: Catalogue | None = None) -> TourRules:
    """Return the rules of a problem file for the verification of a tour.

    Parameters
    ----------
    config : Config
        The problem file.
    tour : Tour
        The tour. Where there is no table its bodies stand in for one.
    catalogue : Catalogue, optional
        The asteroid table.

    Raises
    ------
    InputError
        A value of the problem file is out of range, or its rules need the table.
    """
    if catalogue is None:
        mission = config.mission
        end = () if mission.end_id is None else (mission.end_id,)
        asked = (*mission.start_ids, *mission.sequence, *mission.must_visit, *end)
        ours = {body.id for body in config.bodies}
        catalogue = _bodies_of(tour, tuple(body for body in asked if body not in ours), ours)
        # Which bodies were excluded plays no part in the rules.
        table = msgspec.structs.replace(config.catalogue, exclude_ids=())
        config = msgspec.structs.replace(config, catalogue=table)
    rules = build_problem(config, catalogue).tour_rules()
    if config.catalogue.ephemeris == "spk" and not rules.kernels:
        # What the tour says of them is better than silence: the verification asks for them.
        named = KernelFile(name=Path(config.catalogue.file or "a kernel").name, sha256="unknown")
        rules = msgspec.structs.replace(rules, kernels=tour.rules.kernels or (named,))
    return rules


def kernels_at_hand(config: Config) -> tuple[Path, ...]:
    """Return the SPK kernels from which a configuration's bodies move; none where none do.

    Raises
    ------
    InputError
        They are there, but cannot be used.
    """
    path = Path(config.catalogue.file or "")
    if config.catalogue.ephemeris != "spk" or not path.exists():
        return ()
    return kernel_files(path).spk


def differences(found: TourRules, expected: TourRules) -> list[str]:
    """Return the rules in which two records differ, in words; the catalogue's path aside."""
    names = [field.name for field in msgspec.structs.fields(TourRules)]
    return [
        f"{name} {_short(getattr(found, name))} instead of {_short(getattr(expected, name))}"
        for name in names
        if name not in ("name", "catalogue") and getattr(found, name) != getattr(expected, name)
    ]


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _bodies_of(tour: Tour, named: tuple[int, ...], ours: set[int]) -> Catalogue:
    """Return the visited bodies as a catalogue; the first stands in for others that are named.

    Without those that the problem file has itself.
    """
    bodies = {body.id: body for body in tour.visits or tour.bodies}
    first = next(iter(bodies.values()))
    for body_id in (*named, max(*bodies, *ours, 0) + 1):
        bodies.setdefault(body_id, first)
    bodies = {body_id: body for body_id, body in bodies.items() if body_id not in ours}
    return Catalogue(
        ids=list(bodies),
        names=[body.name for body in bodies.values()],
        epoch_mjd2000=[body.epoch_mjd2000 for body in bodies.values()],
        elements=[_elements(body) for body in bodies.values()],
        source=tour.rules.catalogue,
    )


def _elements(body: TourBody) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    angles = [body.i_rad, body.node_rad, body.argp_rad, body.mean_anomaly_rad]
    return np.array([body.a_m, body.e, *angles])
