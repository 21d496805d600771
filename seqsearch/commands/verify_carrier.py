"""``seqsearch verify`` of a folder with ``M.TXT``: a carrier and its craft, from their files."""

from pathlib import Path
from typing import TYPE_CHECKING

from feasibility import InputError
from feasibility.runtime.terminal import say

if TYPE_CHECKING:
    from feasibility.orbits import Catalogue
    from seqsearch.tours.carrier.reading import CarrierFiles
    from seqsearch.tours.checks import Verification
    from seqsearch.tours.records import TourBody


def verify_files(folder: Path, problem: str | None, catalogue: str | None) -> "Verification":
    """Check the files of a carrier, print how they fare, and return it.

    Parameters
    ----------
    folder : Path
        With ``M.TXT`` and the files of the craft.
    problem : str, optional
        Name of the problem, or a problem file of that name; default: the ``config.toml`` beside
        the files.
    catalogue : str, optional
        The asteroid table; default: where the ``config.toml`` beside the files says.

    Raises
    ------
    InputError
        Something cannot be read, or nothing says what the rules or the bodies are.
    """
    from seqsearch.problems.registry import carrier_rules
    from seqsearch.tours.carrier.reading import read_carrier_files
    from seqsearch.tours.carrier.verify import verify_carrier

    files = read_carrier_files(folder)
    rules = carrier_rules(_name(folder, problem))
    table = _table(folder, catalogue)
    for number, phases in files.craft.items():
        say(f"P{number}: " + " -> ".join([phases[0].start, *(phase.end for phase in phases)]))
    say(f"rules of problem {rules.name}, asteroids of {table.source}")
    verification = verify_carrier(files, _bodies(files, table), rules)
    say(verification.table())
    return verification


def _name(folder: Path, problem: str | None) -> str:
    from seqsearch.problems.problem_file import read_config
    from seqsearch.runs.run_folder import CONFIG

    if problem is not None:
        return read_config(problem).problem.name if problem.endswith(".toml") else problem
    beside = folder / CONFIG
    if not beside.is_file():
        raise InputError(f"{folder}: nothing says whose rules hold; say it with --problem NAME")
    return read_config(str(beside)).problem.name


def _table(folder: Path, catalogue: str | None) -> "Catalogue":
    from feasibility.orbits import read_catalogue
    from seqsearch.problems.problem_file import read_config, table_at_hand
    from seqsearch.runs.run_folder import CONFIG

    table = None
    if catalogue is not None:
        table = read_catalogue(Path(catalogue))
    elif (folder / CONFIG).is_file():
        table = table_at_hand(read_config(str(folder / CONFIG)))
    if table is None:
        raise InputError(
            f"{folder}: the asteroid table is not at hand; say where it is with --catalogue FILE"
        )
    return table


def _bodies(files: "CarrierFiles", table: "Catalogue") -> "dict[str, TourBody]":
    """Return the bodies of the table that the phases name; others are for the verification."""
    from seqsearch.core.recording import tour_body

    names = {
        name
        for phases in files.craft.values()
        for phase in phases
        for name in (phase.start, phase.end)
        if name.isascii() and name.isdigit() and len(name) < 18
    }
    bodies = {}
    for name in names:
        try:
            bodies[name] = tour_body(table, int(table.rows_of([int(name)])[0]))
        except ValueError:
            continue
    return bodies
