"""The command ``seqsearch``."""

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from feasibility import InputError, MissingDependencyError
from feasibility.sims_flanagan.fast.compilation import prefer_fast_compilation

_DESCRIPTION: Final = """\
Find asteroid tours for a low-thrust spacecraft.

A beam search proposes legs to near neighbours in a catalogue of asteroids, a
pruner drops those that cannot be flown, and the rest are optimised in the
Sims-Flanagan model.

  seqsearch run demo                      a synthetic belt; needs no file
  seqsearch run gtoc7 --catalogue FILE    one GTOC7 probe on the official table
  seqsearch resume runs/demo              go on after an interruption
  seqsearch polish runs/demo              improve its tour
  seqsearch verify runs/demo              check the result independently
"""

_RUN: Final = """\
Search for the tour with the most visits and write it to a run folder.

The folder gets config.toml (everything that was set), provenance.json (seed,
versions), counters.csv (what was proposed, pruned, optimised and feasible at
each rank), sequence.json (the tour with every impulse) and sequence.csv (its
legs); tour.png shows it. It is rewritten after each rank: interrupt the run, or give a time
limit, and the best tour so far is there. `seqsearch resume` goes on with it:
checkpoints/ has what that needs. audit.json says what pruning cost: how many of the
flyable legs it dropped, found by optimising a few of the pruned ones.

The same seed gives the same tour with any number of workers, unless a time
limit cuts the search short.
"""

_RESUME: Final = """\
Go on with a run that was interrupted, killed or stopped by a limit.

The run goes on after the last rank that it finished. With the same limits it ends with
the same tour as if it had never stopped. Limits count what earlier sessions used: a run
that has used up its limit needs a larger one.
"""

_POLISH: Final = """\
Make the best tours of a run shorter in time and, with what that frees, longer in asteroids.

All epochs and stays of a tour are optimised together; then other bodies are tried at its
ends, and more of them, each time with all epochs anew. sequence.json is replaced if the
result is better, and sequence.search.json keeps what the search found; polish.json says
what was gained. The same seed gives the same tour with any number of workers, unless a
time limit cuts the work short.
"""

_FIGURES: Final = (".png", ".svg", ".pdf")
_UNITS_S: Final = {"": 1.0, "s": 1.0, "sec": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code.

    0: done (and, for ``verify``, everything holds); 1: verification failed;
    2: input that cannot be used, with one line on stderr.
    """
    prefer_fast_compilation()
    parsed = _parser().parse_args(arguments)
    try:
        return int(parsed.run(parsed))
    except (InputError, MissingDependencyError) as error:
        print(f"seqsearch: {error}", file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="seqsearch", description=_DESCRIPTION, formatter_class=raw
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser(
        "run", help="search for a tour", description=_RUN, formatter_class=raw
    )
    run.add_argument("problem", help="name of a built-in problem, or a TOML file")
    run.add_argument("--catalogue", metavar="FILE", help="asteroid table (GTOC2, 4, 5, 7, 11)")
    run.add_argument("--out", metavar="DIR", help="run folder (default: runs/PROBLEM)")
    run.add_argument("--seed", type=int, default=0, help="seed of the search (default: 0)")
    _add_budget(run)
    run.add_argument("--beam-width", type=int, metavar="N", help="nodes kept at each rank")
    run.add_argument("--passes", type=int, metavar="N", help="beams run one after another")
    run.add_argument(
        "--pruner",
        metavar="SPEC",
        help="such as lambert:1.3,mima2:0.97; default:RECALL or FILE.seqmodel:RECALL for a "
        "trained model; none keeps all",
    )
    run.add_argument("--solver", choices=("fast", "reference"), help="leg solver")
    run.add_argument(
        "--polish",
        metavar="T",
        help="then polish the best tours for 90s, 5min (see polish)",
    )
    run.set_defaults(run=_run)

    resume = commands.add_parser(
        "resume", help="go on with a run", description=_RESUME, formatter_class=raw
    )
    resume.add_argument("path", metavar="RUN", help="run folder")
    resume.add_argument(
        "--from-rank",
        metavar="PASS:RANK",
        help="go on after this rank, such as 2:5, and drop what came later; 0:0 is the beginning",
    )
    _add_budget(resume)
    resume.set_defaults(run=_resume)

    polish = commands.add_parser(
        "polish", help="improve a run's tour", description=_POLISH, formatter_class=raw
    )
    polish.add_argument("path", metavar="RUN", help="run folder")
    polish.add_argument(
        "--time-limit", metavar="T", help="stop after 90s, 10min, 1h (default: after some rounds)"
    )
    polish.add_argument("--seed", type=int, default=0, help="seed of the moves (default: 0)")
    polish.add_argument("--workers", type=int, help="processes (default: one a core)")
    polish.set_defaults(run=_polish)

    verify = commands.add_parser(
        "verify",
        help="check a tour independently",
        description=(
            "Integrate every leg of a run's tour with scipy's DOP853 between impulses and check "
            "end states (1000 km, 1 m/s), throttles, masses, stays, duplicates, window and "
            "duration; for GTOC5 also launch, fly-bys and drops. Exit code 0 if all hold, else 1."
        ),
    )
    verify.add_argument("path", metavar="RUN", help="run folder, or a sequence.json")
    verify.add_argument(
        "--catalogue", metavar="FILE", help="also compare the elements with this table"
    )
    verify.set_defaults(run=_verify)

    plot = commands.add_parser(
        "plot",
        help="draw a tour",
        description="Draw a tour: its path in the ecliptic, mass and throttle over time.",
    )
    plot.add_argument("path", metavar="RUN", help="run folder, or a sequence.json")
    plot.add_argument("--out", metavar="FILE", required=True, help="a .png, .svg or .pdf file")
    plot.set_defaults(run=_plot)

    problems = commands.add_parser(
        "problems",
        help="show the built-in problems",
        description=(
            "List the built-in problems, or print one as TOML: the starting point for a problem "
            "file of your own."
        ),
    )
    problems.add_argument("name", nargs="?", help="print this one as TOML")
    problems.set_defaults(run=_problems)
    return parser


def _add_budget(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--time-limit",
        metavar="T",
        help="stop after 90s, 10min, 1h in all; passes go on until then",
    )
    command.add_argument(
        "--max-solves",
        type=int,
        metavar="N",
        help="stop after so many full optimisations in all; passes go on until then",
    )
    command.add_argument("--workers", type=int, help="processes (default: one a core)")


def _run(options: argparse.Namespace) -> int:
    from seqsearch.commands.run import run_search
    from seqsearch.runs.session import Budget

    return run_search(
        options.problem,
        catalogue=options.catalogue,
        out=None if options.out is None else Path(options.out),
        seed=options.seed,
        budget=Budget(
            time_limit_s=_seconds(options.time_limit),
            max_solves=options.max_solves,
            workers=options.workers,
        ),
        overrides={
            "beam_width": options.beam_width,
            "passes": options.passes,
            "pruner": options.pruner,
            "solver": options.solver,
        },
        polish_s=_seconds(options.polish, "--polish"),
    )


def _resume(options: argparse.Namespace) -> int:
    from seqsearch.commands.resume import parse_rank, resume_search

    return resume_search(
        Path(options.path),
        after=None if options.from_rank is None else parse_rank(options.from_rank),
        time_limit_s=_seconds(options.time_limit),
        max_solves=options.max_solves,
        workers=options.workers,
    )


def _polish(options: argparse.Namespace) -> int:
    from seqsearch.commands.polish import polish_run

    return polish_run(
        Path(options.path),
        time_limit_s=_seconds(options.time_limit),
        seed=options.seed,
        workers=options.workers,
    )


def _seconds(duration: str | None, option: str = "--time-limit") -> float | None:
    return None if duration is None else parse_duration(duration, option)


def _verify(options: argparse.Namespace) -> int:
    from feasibility.orbits import read_catalogue
    from seqsearch.runs.fleet import check_disjoint, is_fleet, read_fleet
    from seqsearch.tours.tour import read_tour
    from seqsearch.tours.verify import Verification, verify_tour

    catalogue = None if options.catalogue is None else read_catalogue(Path(options.catalogue))
    fleet = is_fleet(Path(options.path))
    tours = read_fleet(Path(options.path)) if fleet else [read_tour(_sequence_path(options.path))]
    outcomes = [verify_tour(tour, catalogue) for tour in tours]
    for tour, verification in zip(tours, outcomes, strict=True):
        print(tour.one_line())
        print(tour.summary())
        print(verification.table())
    if fleet:
        outcomes.append(Verification((check_disjoint(tours),)))
        print(f"{sum(tour.n_asteroids for tour in tours)} asteroids on {len(tours)} probes")
        print(outcomes[-1].table())
    passed = all(verification.passed for verification in outcomes)
    print("verified" if passed else "NOT verified")
    return 0 if passed else 1


def _plot(options: argparse.Namespace) -> int:
    from seqsearch.tours.plots import plot_tour
    from seqsearch.tours.tour import read_tour

    out = Path(options.out)
    if out.suffix not in _FIGURES:
        raise InputError(f"--out {out}: expected a name that ends in {', '.join(_FIGURES)}")
    plot_tour(read_tour(_sequence_path(options.path)), out)
    return 0


def _sequence_path(run: str) -> Path:
    from seqsearch.runs.run_folder import SEQUENCE

    path = Path(run)
    return path / SEQUENCE if path.is_dir() else path


def _problems(options: argparse.Namespace) -> int:
    from seqsearch.problems.problem_file import builtin_problems, read_config

    texts = builtin_problems()
    if options.name is None:
        for name in texts:
            print(f"{name:<12} {read_config(name).problem.description}")
        return 0
    if options.name not in texts:
        raise InputError(f"{options.name}: no such problem; known are {', '.join(texts)}")
    print(texts[options.name], end="")
    return 0


def parse_duration(text: str, option: str = "--time-limit") -> float:
    """Return a duration such as ``90s``, ``10min``, ``1.5h`` or ``600`` in seconds.

    Raises
    ------
    InputError
        Not a positive number with one of these units.
    """
    match = re.fullmatch(r"\s*([0-9]*\.?[0-9]+)\s*([a-z]*)\s*", text)
    if match is None or match[2] not in _UNITS_S or float(match[1]) <= 0:
        raise InputError(f"{option} {text!r}: expected a duration such as 90s, 10min or 1h")
    return float(match[1]) * _UNITS_S[match[2]]
