"""``seqsearch run``: read, check, begin a run folder, search."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from feasibility import InputError
from seqsearch.budget import Limits
from seqsearch.commands.options import add_limits, add_output, print_result, seconds

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands

_DESCRIPTION: Final = """\
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


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    run = commands.add_parser(
        "run",
        help="search for a tour",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    run.add_argument("problem", help="name of a built-in problem, or a TOML file")
    run.add_argument("--catalogue", metavar="FILE", help="asteroid table")
    run.add_argument(
        "--select", metavar="EXPR", help="which of its bodies, such as 'a > 2.2 and H < 16'"
    )
    run.add_argument("--out", metavar="DIR", help="run folder (default: runs/PROBLEM)")
    run.add_argument("--seed", type=int, default=0, help="seed of the search (default: 0)")
    add_limits(run)
    run.add_argument("--beam-width", type=int, metavar="N", help="nodes kept at each rank")
    run.add_argument("--passes", type=int, metavar="N", help="beams run one after another")
    run.add_argument(
        "--pruner",
        metavar="SPEC",
        help="such as lambert:1.3,mima2:0.97; default:RECALL or FILE.seqmodel:RECALL for a "
        "trained model; none keeps all",
    )
    run.add_argument("--solver", choices=("fast", "reference", "best", "auto"), help="leg solver")
    run.add_argument(
        "--polish",
        metavar="T",
        help="then polish the best tours for 90s, 5min (see polish)",
    )
    run.add_argument(
        "--refine",
        action="store_true",
        help="then refine the best tour to continuous thrust (see refine)",
    )
    add_output(run)
    run.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    code, folder = run_search(
        options.problem,
        catalogue=options.catalogue,
        select=options.select,
        out=None if options.out is None else Path(options.out),
        seed=options.seed,
        limits=Limits(
            time_limit_s=seconds(options.time_limit),
            max_solves=options.max_solves,
            workers=options.workers,
            scheduler=options.scheduler,
        ),
        overrides={
            "beam_width": options.beam_width,
            "passes": options.passes,
            "pruner": options.pruner,
            "solver": options.solver,
        },
        polish_s=seconds(options.polish, "--polish"),
        refine=options.refine,
    )
    return print_result(options, folder, code)


def run_search(
    problem_name: str,
    *,
    catalogue: str | None,
    out: Path | None,
    seed: int,
    limits: Limits,
    overrides: dict[str, Any],
    polish_s: float | None = None,
    select: str | None = None,
    refine: bool = False,
) -> tuple[int, Path]:
    """Run a search as the command line asks for it and return exit code and run folder.

    With `polish_s`, the best tours are polished for that many seconds afterwards.
    A fleet polishes each probe within the time limit instead. With `refine`, the best tour is
    refined to continuous thrust at the end, unless the run was interrupted.

    Everything is read and checked before the run folder is made.

    Raises
    ------
    InputError
        Anything in the input that cannot be used.
    """
    # Imported here: the search and what it needs take a second to load.
    from seqsearch.problems.problem_file import (
        override,
        read_config,
        with_catalogue,
        with_selection,
    )
    from seqsearch.problems.registry import is_carried
    from seqsearch.runs.begin import begin_search
    from seqsearch.runs.carrier_run import begin_carrier
    from seqsearch.runs.fleet_run import run_fleet
    from seqsearch.runs.flying import fly_run
    from seqsearch.runs.polishing import polish_run
    from seqsearch.runs.refining import refine_run

    if seed < 0:
        raise InputError(f"--seed {seed}: expected zero or more")
    config = override(read_config(problem_name), **overrides)
    if catalogue is not None:
        config = with_catalogue(config, catalogue)
    if select is not None:
        config = with_selection(config, select)
    if config.catalogue.file is not None:
        # The run folder's copy is read from elsewhere when the run is resumed.
        config = with_catalogue(config, str(Path(config.catalogue.file).absolute()))
    folder = out or Path("runs") / config.problem.name
    if config.mission.sequence:
        code = fly_run(config, folder, seed, limits)
    elif is_carried(config.problem.name):
        code = begin_carrier(config, folder, seed, limits)
    elif config.fleet.probes > 1:
        code = run_fleet(config, folder, seed=seed, limits=limits, search_probe=begin_search)
    else:
        code = begin_search(config, folder, seed, limits)
        if code == 0 and polish_s is not None:
            code = polish_run(
                folder,
                time_limit_s=polish_s,
                seed=seed,
                workers=limits.workers,
                scheduler=limits.scheduler,
            )
    if code == 0 and refine:
        refine_run(folder)
    return code, folder
