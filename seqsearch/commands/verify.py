"""``seqsearch verify``: check a tour, or those of a fleet, independently."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from seqsearch.commands.options import sequence_path

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    verify = commands.add_parser(
        "verify",
        help="check a tour independently",
        description=(
            "Integrate every leg of a run's tour with scipy's DOP853 between impulses and check "
            "end states (1000 km, 1 m/s), throttles, masses, stays, duplicates, window, "
            "duration and score, and what the problem's rules allow besides: launch, fly-bys, "
            "masses left behind, groups. Exit code 0 if all hold, else 1."
        ),
    )
    verify.add_argument("path", metavar="RUN", help="run folder, or a sequence.json")
    verify.add_argument(
        "--catalogue", metavar="FILE", help="also compare the elements with this table"
    )
    verify.set_defaults(run=_verify)


def _verify(options: argparse.Namespace) -> int:
    from feasibility.orbits import read_catalogue
    from seqsearch.runs.fleet import check_disjoint, is_fleet, read_fleet
    from seqsearch.tours.checks import Verification
    from seqsearch.tours.tour_files import read_tour
    from seqsearch.tours.verify import verify_tour

    catalogue = None if options.catalogue is None else read_catalogue(Path(options.catalogue))
    fleet = is_fleet(Path(options.path))
    tours = read_fleet(Path(options.path)) if fleet else [read_tour(sequence_path(options.path))]
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
