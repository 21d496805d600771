"""``seqsearch fly``: when, and with what masses, a sequence of one's own can be flown."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility import InputError
from seqsearch.budget import Limits
from seqsearch.commands.options import add_limits, add_output, print_result, seconds

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands

_DESCRIPTION: Final = """\
Fly a sequence of bodies that you name, in the order that you name.

Epochs, flight times and stays are found by a beam search in which every tour follows the
sequence; then all of them are improved together. The run folder is like that of any run: verify,
refine, export and report take it. If the sequence breaks, its longest part that can be flown is
written, and a line says which leg fails and how far it is from feasible.

  seqsearch fly 3673 2764 5753 --problem demo
  seqsearch fly 14101 10973 2346 --problem belt.toml --catalogue asteroids.txt
  seqsearch fly --problem mine.toml             with sequence = [...] in its table [mission]

Exit codes: 0 the whole sequence is flown, 1 it breaks.
"""


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    fly = commands.add_parser(
        "fly",
        help="fly a sequence of your own",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    fly.add_argument("ids", type=int, nargs="*", metavar="ID", help="bodies in order of visit")
    fly.add_argument(
        "--problem", required=True, help="name of a built-in problem, or a TOML file: the rules"
    )
    fly.add_argument("--catalogue", metavar="FILE", help="asteroid table")
    fly.add_argument("--out", metavar="DIR", help="run folder (default: runs/PROBLEM-sequence)")
    fly.add_argument("--seed", type=int, default=0, help="seed of the epochs (default: 0)")
    add_limits(fly)
    add_output(fly)
    fly.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    # Imported here: the search and what it needs take a second to load.
    from seqsearch.problems.problem_file import read_config, with_catalogue, with_sequence
    from seqsearch.runs.flying import fly_run

    if options.seed < 0:
        raise InputError(f"--seed {options.seed}: expected zero or more")
    config = read_config(options.problem)
    if options.ids:
        config = with_sequence(config, tuple(options.ids))
    if not config.mission.sequence:
        raise InputError(
            f"{options.problem}: no sequence; expected ids, or sequence = [...] in its table "
            "[mission]"
        )
    if options.catalogue is not None:
        config = with_catalogue(config, options.catalogue)
    if config.catalogue.file is not None:
        # The run folder's copy is read from elsewhere when the run is resumed.
        config = with_catalogue(config, str(Path(config.catalogue.file).absolute()))
    folder = Path(options.out or f"runs/{config.problem.name}-sequence")
    limits = Limits(
        time_limit_s=seconds(options.time_limit),
        max_solves=options.max_solves,
        workers=options.workers,
        scheduler=options.scheduler,
    )
    return print_result(options, folder, fly_run(config, folder, options.seed, limits))
