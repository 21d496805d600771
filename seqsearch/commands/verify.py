"""``seqsearch verify``: check a tour, or those of a fleet, independently."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility.runtime.terminal import say, say_json
from seqsearch.commands.options import add_output, sequence_path

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands
    from seqsearch.problems.problem_file import Config
    from seqsearch.tours.checks import Verification
    from seqsearch.tours.tour import Tour

_DESCRIPTION: Final = """\
Integrate every leg of a run's tour with scipy's DOP853 between impulses and check end
states (1000 km, 1 m/s), throttles, masses, stays, duplicates, window, duration and score,
and what the problem's rules allow besides: launch, fly-bys, masses left behind, groups.

The rules come from the problem, not from the file under test: from the run's config.toml,
or from --problem. A tour that keeps only the rules in its own file is not verified. With
the asteroid table at hand (--catalogue, or where config.toml says) bodies are compared with
it. Where bodies move as SPK kernels say, arrivals are checked against SPICE itself, with the
very files of the run (--catalogue, or where config.toml says). Exit code 0 if everything holds,
else 1.

With --continuous the rows of a refined tour are checked instead, as they are handed in: the
motion from each row to the next and through all rows of a phase, thrust, mass flow, and the
bodies met, by the rules of the problem and the elements of the asteroid table.

A folder with M.TXT holds a carrier and its craft, P1.TXT and so on. These files alone are checked,
by the rules of --problem and with the asteroid table of --catalogue.
"""


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    verify = commands.add_parser(
        "verify",
        help="check a tour independently",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verify.add_argument(
        "path", metavar="RUN", help="run folder, sequence.json, or folder with M.TXT"
    )
    verify.add_argument(
        "--problem",
        metavar="NAME|FILE",
        help="whose rules hold (default: the run's config.toml, or the built-in problem of "
        "the tour's name)",
    )
    verify.add_argument(
        "--catalogue", metavar="FILE", help="compare the bodies with this asteroid table"
    )
    verify.add_argument(
        "--continuous",
        action="store_true",
        help="check trajectory.rows of the run, or a file of rows instead of RUN",
    )
    verify.add_argument(
        "--position-tolerance",
        type=float,
        default=1000.0,
        metavar="KM",
        help="with --continuous: how near to come to bodies (default: 1000)",
    )
    verify.add_argument(
        "--velocity-tolerance",
        type=float,
        default=1.0,
        metavar="M_S",
        help="with --continuous: largest velocity error at bodies (default: 1)",
    )
    add_output(verify)
    verify.set_defaults(run=_verify)


def _verify(options: argparse.Namespace) -> int:
    from seqsearch.commands.verify_carrier import verify_files
    from seqsearch.runs.fleet import check_disjoint, is_fleet, probe_paths
    from seqsearch.tours.carrier.reading import is_carrier
    from seqsearch.tours.checks import Verification
    from seqsearch.tours.tour_files import read_tour

    path = Path(options.path)
    if is_carrier(path):
        return _concluded([verify_files(path, options.problem, options.catalogue)], options.json)
    if options.continuous:
        return _verify_continuous(options)
    fleet = is_fleet(path)
    paths = probe_paths(path) if fleet else [sequence_path(options.path)]
    tours = [read_tour(file) for file in paths]
    outcomes = [
        _verified(file, tour, options.problem, options.catalogue)
        for file, tour in zip(paths, tours, strict=True)
    ]
    if fleet:
        together = Verification((check_disjoint(tours),))
        outcomes.append(together)
        say(f"{sum(tour.n_asteroids for tour in tours)} asteroids on {len(tours)} probes")
        say(together.table())
    return _concluded(outcomes, options.json)


def _verify_continuous(options: argparse.Namespace) -> int:
    from seqsearch.commands.verify_continuous import verify_continuous
    from seqsearch.tours.verify_rows import Tolerances

    tolerances = Tolerances(options.position_tolerance, options.velocity_tolerance)
    outcomes = verify_continuous(
        Path(options.path), options.problem, options.catalogue, tolerances
    )
    return _concluded(outcomes, options.json)


def _concluded(outcomes: "list[Verification]", as_json: bool) -> int:
    """Say whether all checks passed, and return the exit code."""
    passed = all(outcome.passed for outcome in outcomes)
    say("verified" if passed else "NOT verified")
    if as_json:
        checks = [asdict(check) for outcome in outcomes for check in outcome.checks]
        say_json({"verified": passed, "checks": checks})
    return 0 if passed else 1


def _verified(
    file: Path, tour: "Tour", problem: str | None, catalogue: str | None
) -> "Verification":
    """Check one tour, print how it fares, and return it."""
    from feasibility.orbits import read_catalogue
    from seqsearch.problems.problem_file import table_at_hand, whole_catalogue, with_catalogue
    from seqsearch.problems.rules_of import differences, kernels_at_hand, rules_of
    from seqsearch.tours.checks import Check, Verification
    from seqsearch.tours.verify import verify_tour

    say(tour.one_line())
    config, source = _problem_of(file, tour, problem)
    if config is None:
        table = None if catalogue is None else read_catalogue(Path(catalogue))
        verification = _print(verify_tour(tour, table), file, tour)
        say(
            "checked against the rules in its own file alone, which prove nothing; "
            "say whose rules hold with --problem NAME|FILE"
        )
        unknown = Check("rules of a known problem", False, "the file's own", "a problem's")
        return Verification((*verification.checks, unknown))
    if catalogue is None:
        table = table_at_hand(config)
    else:
        config = with_catalogue(config, catalogue)
        table = whole_catalogue(config)
    kernels = kernels_at_hand(config)
    rules = rules_of(config, tour, table)
    say(f"rules of problem {rules.name}, from {source}")
    for difference in differences(tour.rules, rules):
        say(f"the file states other rules: {difference}")
    verification = _print(verify_tour(tour, table, rules, kernels), file, tour)
    if rules.kernels and not kernels:
        say(
            f"the bodies move as the kernels say, which are not at {config.catalogue.file}: "
            "arrivals are not checked; say where they are with --catalogue PATH"
        )
    if not verification.passed and verify_tour(tour, table, kernels=kernels).passed:
        say("it keeps only the rules in its own file")
    return verification


def _print(verification: "Verification", file: Path, tour: "Tour") -> "Verification":
    from seqsearch.tours.checks import Verification
    from seqsearch.tours.tour_files import check_csv

    beside = file.with_suffix(".csv")
    if beside.is_file():
        verification = Verification((*verification.checks, check_csv(tour, beside)))
    say(tour.summary())
    say(verification.table())
    return verification


def _problem_of(file: Path, tour: "Tour", problem: str | None) -> "tuple[Config | None, str]":
    """Return the problem whose rules hold and where it is from; None where nothing says."""
    from seqsearch.problems.problem_file import read_config
    from seqsearch.problems.registry import builtin_problems
    from seqsearch.runs.run_folder import CONFIG

    if problem is not None:
        return read_config(problem), problem
    beside = file.parent / CONFIG
    if beside.is_file():
        return read_config(str(beside)), str(beside)
    if tour.rules.name in builtin_problems():
        return read_config(tour.rules.name), f"the built-in problem {tour.rules.name}"
    return None, ""
