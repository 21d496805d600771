"""``seqsearch verify --continuous``: check the rows of a refined tour, or of any file of rows."""

from pathlib import Path
from typing import TYPE_CHECKING

from feasibility import InputError
from feasibility.runtime.terminal import say

if TYPE_CHECKING:
    from feasibility.orbits import Catalogue
    from seqsearch.problems.problem_file import Config
    from seqsearch.tours.checks import Check, Verification
    from seqsearch.tours.records import TourBody
    from seqsearch.tours.tour import TourRules
    from seqsearch.tours.trajectory import Trajectory
    from seqsearch.tours.verify_rows import Tolerances


def verify_continuous(
    path: Path, problem: str | None, catalogue: str | None, tolerances: "Tolerances"
) -> "list[Verification]":
    """Check the rows of a run, those of a fleet or a file, print how they fare, and return it.

    Parameters
    ----------
    path : Path
        Run folder, or a file of rows.
    problem : str, optional
        Whose rules hold; default: the ``config.toml`` beside the rows.
    catalogue : str, optional
        The asteroid table, or SPK kernels; default: where the problem says.
    tolerances : Tolerances
        How exactly bodies have to be met.

    Raises
    ------
    InputError
        Something cannot be read, or nothing says what the rules or the bodies are.
    """
    from seqsearch.runs.fleet import is_fleet, probe_paths
    from seqsearch.tours.trajectory_files import ROWS

    if path.is_dir():
        folders = [file.parent for file in probe_paths(path)] if is_fleet(path) else [path]
        files = [folder / ROWS for folder in folders]
    else:
        files = [path]
    return [_verified(file, problem, catalogue, tolerances) for file in files]


def _verified(
    file: Path, problem: str | None, catalogue: str | None, tolerances: "Tolerances"
) -> "Verification":
    from seqsearch.problems.problem_file import table_at_hand, whole_catalogue, with_catalogue
    from seqsearch.problems.rules_of import kernels_at_hand
    from seqsearch.tours.checks import Verification
    from seqsearch.tours.export.rows import read_rows
    from seqsearch.tours.trajectory_files import ROWS
    from seqsearch.tours.verify_rows import verify_rows

    if file.name == ROWS and not file.is_file():
        raise InputError(f"{file}: not there; refine the tour first (seqsearch refine RUN)")
    trajectory = read_rows(file)
    config, source = _problem_of(file, problem)
    if catalogue is not None:
        config = with_catalogue(config, catalogue)
    table = table_at_hand(config) if catalogue is None else whole_catalogue(config)
    if table is None:
        raise InputError(
            f"{file}: the asteroid table of problem {config.problem.name} is not at hand; "
            "say where it is with --catalogue FILE"
        )
    rules = _rules(config, table)
    say(" -> ".join([trajectory.phases[0].start, *(phase.end for phase in trajectory.phases)]))
    say(f"rules of problem {rules.name}, from {source}")
    verification = verify_rows(
        trajectory,
        _bodies(trajectory, rules, table),
        rules,
        tolerances,
        kernels_at_hand(config),
    )
    verification = Verification((*verification.checks, *_belongs(file, trajectory)))
    say(verification.table())
    return verification


def _problem_of(file: Path, problem: str | None) -> "tuple[Config, str]":
    from seqsearch.problems.problem_file import read_config
    from seqsearch.runs.run_folder import CONFIG

    if problem is not None:
        return read_config(problem), problem
    beside = file.parent / CONFIG
    if beside.is_file():
        return read_config(str(beside)), str(beside)
    raise InputError(f"{file}: nothing says whose rules hold; say it with --problem NAME|FILE")


def _rules(config: "Config", table: "Catalogue") -> "TourRules":
    import msgspec

    from seqsearch.problems.problem_file import build_problem

    # Which bodies were excluded plays no part in the rules.
    catalogue = msgspec.structs.replace(config.catalogue, exclude_ids=())
    config = msgspec.structs.replace(config, catalogue=catalogue)
    return build_problem(config, table).tour_rules()


def _bodies(
    trajectory: "Trajectory", rules: "TourRules", table: "Catalogue"
) -> "dict[str, TourBody]":
    """Return the bodies that the phases name, from the table and from the rules."""
    from seqsearch.core.recording import tour_body
    from seqsearch.tours.labels import named_bodies

    bodies = named_bodies(rules)
    others = "".join(f" or {name}" for name in bodies)
    for phase in trajectory.phases:
        for name in {phase.start, phase.end} - bodies.keys():
            try:
                bodies[name] = tour_body(table, int(table.rows_of([int(name)])[0]))
            except ValueError:
                raise InputError(
                    f"{phase}: no body {name!r}, expected an id of {table.source}{others}"
                ) from None
    return bodies


def _belongs(file: Path, trajectory: "Trajectory") -> "list[Check]":
    """Return the check that the rows of a run fly the tour that is there now."""
    from seqsearch.runs.run_folder import SEQUENCE
    from seqsearch.tours.checks import Check
    from seqsearch.tours.labels import body_label
    from seqsearch.tours.tour_files import read_tour
    from seqsearch.tours.trajectory_files import ROWS, SUMMARY, read_summary, tour_digest

    if file.name != ROWS or not (file.parent / SEQUENCE).is_file():
        return []
    tour = read_tour(file.parent / SEQUENCE)
    legs = [(body_label(tour, leg.from_id), body_label(tour, leg.to_id)) for leg in tour.legs]
    same = legs == [(phase.start, phase.end) for phase in trajectory.phases]
    if same and (file.parent / SUMMARY).is_file():
        same = read_summary(file.parent)["tour_sha256"] == tour_digest(tour)
    found = "it is" if same else "another one; refine again"
    return [Check(f"flies the tour of {SEQUENCE}", same, found, "the same tour")]
