"""Check a leg solver against the reference legs and against JPL's winning GTOC7 tour.

The reference legs are four families of legs whose maximum initial mass m* was
found with many starts and is a lower bound of the true optimum; so a mass that
is larger, and confirmed by pykep's leg, is right. The published tour gives legs
that were flown in the winners' own low-thrust model, so m* has to reach the
mass they flew with, up to the 1 % that dates rounded to the day can cost.

The reference is shown twice: alone, and started also from the fast solver's
solution where that is larger (on the other rows it would add a start that has
lost already). `--method started` shows the second alone and quickly: rows whose
fast solution is fine need no reference, which would keep it or better it.

Run from the root of the checkout, with the folder `shared` beside it:

    python benchmarks/reference_legs.py                    # 100 legs a family
    python benchmarks/reference_legs.py --legs all --workers 2
    python benchmarks/reference_legs.py --method started --legs all
    python benchmarks/reference_legs.py --method fast --legs all

Exit code 1 if a target is missed: m* within 0.5 % or larger on 98 % of the rows
over all families (the reference: started from the fast solver's solutions too),
all 33 legs of the tour with m* >= 0.985 m0.
"""

import argparse
import csv
import dataclasses
import itertools
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs, LegSolutions, Spacecraft
from feasibility.constants import mjd_to_mjd2000
from feasibility.orbits import read_catalogue
from feasibility.sims_flanagan import solve_max_initial_mass

FAMILIES = ("search", "table1", "nea", "craft")
TOLERANCE = 0.005
TARGET_SHARE = 0.98
TARGET_MARGIN = 0.985
GTOC7_PROBE = Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0)
CHUNK = 10
STARTED = "started"


@final
@dataclasses.dataclass(frozen=True)
class Tally:
    """Counts of one family; every count is of rows."""

    n: int
    solved: int
    fine: int
    better: int
    labels_equal: int
    clear: int
    clear_equal: int


def read_reference(path: Path) -> tuple[Legs, NDArray[np.float64]]:
    """Return the legs of one family and their reference m*, (n,) kg."""
    table = np.load(path)
    names = list(table["columns"])
    column = {name: table["rows"][:, names.index(name)] for name in names}
    states = [
        np.stack([column[f"{kind}{body}{axis}"] for kind in "rv" for axis in "xyz"], axis=1)
        for body in (1, 2)
    ]
    legs = Legs(
        *states,
        column["tof_days"],
        column["m0_kg"],
        column["thrust_n"],
        column["isp_s"],
        0.0,
        t_dep_mjd2000=column["t0_mjd2000"],
        dep_id=column["from_id"],
        arr_id=column["to_id"],
    )
    return legs, column["m_star_kg"]


def read_tour(tour: Path, table: Path) -> Legs:
    """Return the asteroid-to-asteroid legs of a published GTOC7 tour.

    A leg departs at arrival plus stay, with the mass after that event, and
    ends at the next arrival of the same probe.
    """
    catalogue = read_catalogue(table)
    with tour.open(newline="") as file:
        events = [row for row in csv.DictReader(file) if row["asteroid_id"].isdigit()]
    pairs = [(a, b) for a, b in itertools.pairwise(events) if a["probe"] == b["probe"]]
    departure = [
        mjd_to_mjd2000(float(a["arrival_mjd_day"]) + float(a["stay_d"])) for a, _ in pairs
    ]
    arrival = [mjd_to_mjd2000(float(b["arrival_mjd_day"])) for _, b in pairs]
    ids = np.array([[int(a["asteroid_id"]), int(b["asteroid_id"])] for a, b in pairs])
    return Legs(
        catalogue.states_at(catalogue.rows_of(ids[:, 0]), np.array(departure)),
        catalogue.states_at(catalogue.rows_of(ids[:, 1]), np.array(arrival)),
        np.array(arrival) - np.array(departure),
        [float(a["mass_after_event_kg"]) for a, _ in pairs],
        GTOC7_PROBE.thrust,
        GTOC7_PROBE.isp,
        GTOC7_PROBE.m_dry,
        t_dep_mjd2000=departure,
        dep_id=ids[:, 0],
        arr_id=ids[:, 1],
    )


def solve(legs: Legs, method: str, workers: int) -> LegSolutions:
    """Solve all legs, in processes if there are several workers."""
    job = partial(solve_max_initial_mass, method=method)
    if workers == 1 or method == "fast":
        return job(legs)
    # Neighbouring rows may be equally hard, so the work goes out in small chunks.
    chunks = [
        legs.take(np.arange(at, min(at + CHUNK, len(legs)))) for at in range(0, len(legs), CHUNK)
    ]
    with ProcessPoolExecutor(workers) as pool:
        return LegSolutions.concatenate(list(pool.map(job, chunks)))


def start_again(
    legs: Legs, known: LegSolutions, guess: LegSolutions, rows: NDArray[np.int64]
) -> LegSolutions:
    """Return what is known, some rows solved by the reference with one start more.

    Parameters
    ----------
    legs : Legs
        The legs.
    known, guess : LegSolutions
        What is known of them, and solutions to start from.
    rows : (k,) int64
        Rows that are solved again.
    """
    again = solve_max_initial_mass(legs.take(rows), method="reference", guess=guess.take(rows))
    merged = {}
    for field in dataclasses.fields(LegSolutions):
        merged[field.name] = getattr(known, field.name).copy()
        merged[field.name][rows] = getattr(again, field.name)
    return LegSolutions(**merged)


def tally(legs: Legs, reference: NDArray[np.float64], solutions: LegSolutions) -> Tally:
    """Compare solutions with the reference; a reference of 0 says nothing, any answer is fine."""
    known = reference > 0
    ratio = np.where(known, solutions.m0 / np.where(known, reference, 1.0), 1.0)
    margin = np.log(np.where(known, reference, 1e-9) / legs.m0)
    equal = (legs.m0 <= solutions.m0) == (legs.m0 <= reference)
    clear = np.abs(margin) >= TOLERANCE
    return Tally(
        n=len(legs),
        solved=int(solutions.converged.sum()),
        fine=int((ratio >= 1.0 - TOLERANCE).sum()),
        better=int((ratio > 1.0 + TOLERANCE).sum()),
        labels_equal=int(equal.sum()),
        clear=int(clear.sum()),
        clear_equal=int((equal & clear).sum()),
    )


def fine_share(tallies: list[Tally]) -> float:
    """Return the share of all rows whose mass is within the tolerance or larger."""
    return sum(counts.fine for counts in tallies) / sum(counts.n for counts in tallies)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--method",
        choices=("reference", STARTED, "fast"),
        default="reference",
        help="solver (default: %(default)s)",
    )
    parser.add_argument("--legs", default="100", metavar="N|all", help="sample a family")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default: %(default)s)")
    parser.add_argument("--workers", type=int, default=1, help="processes (default: %(default)s)")
    parser.add_argument("--shared", type=Path, default=Path("../shared"), help="data folder")
    options = parser.parse_args(arguments)
    if options.legs != "all" and not options.legs.isdigit():
        parser.error(f"argument --legs: {options.legs!r}, expected a number or 'all'")
    rng = np.random.default_rng(options.seed)

    print(f"method {options.method}, {options.legs} legs a family, seed {options.seed}")
    print("m* against the reference: fine = within 0.5 % or larger, larger = by more than 0.5 %")
    print("labels m0 <= m*: all rows, and those with |log(m*/m0)| >= 0.005\n")
    print("family    legs  solved    fine  larger  labels   clear  median ms  mean ms", end="")
    both = options.method == "reference"
    print("  from the fast solver's too: fine  larger  labels" if both else "")
    tallies, started = [], []
    for family in FAMILIES:
        legs, reference = read_reference(options.shared / "legs" / f"reference_{family}.npz")
        if options.legs != "all":
            rows = np.sort(rng.permutation(len(legs))[: int(options.legs)])
            legs, reference = legs.take(rows), reference[rows]
        if options.method == STARTED:
            fast = solve(legs, "fast", 1)
            short = np.flatnonzero(fast.m0 < (1.0 - TOLERANCE) * reference)
            solutions = start_again(legs, fast, fast, short)
        else:
            solutions = solve(legs, options.method, options.workers)
        counts = tally(legs, reference, solutions)
        tallies.append(counts)
        milliseconds = 1e3 * solutions.seconds
        print(
            f"{family:8} {counts.n:5d} {counts.solved / counts.n:7.3f} "
            f"{counts.fine / counts.n:7.3f} {counts.better / counts.n:7.3f} "
            f"{counts.labels_equal / counts.n:7.3f} {counts.clear_equal / counts.clear:7.3f} "
            f"{np.median(milliseconds):10.1f} {milliseconds.mean():8.1f}",
            end="" if both else "\n",
            flush=True,
        )
        if both:
            fast = solve(legs, "fast", 1)
            larger = np.flatnonzero(fast.m0 > solutions.m0)
            counts = tally(legs, reference, start_again(legs, solutions, fast, larger))
            started.append(counts)
            print(
                f"{counts.fine / counts.n:33.3f} {counts.better / counts.n:7.3f} "
                f"{counts.labels_equal / counts.n:7.3f}",
                flush=True,
            )
    share = fine_share(tallies)
    print(f"\nall families: fine {share:.4f} of the rows (target {TARGET_SHARE})")
    if both:
        share = fine_share(started)
        print(f"started from the fast solver's solutions too: fine {share:.4f}")

    tour = read_tour(
        options.shared / "legs" / "gtoc7_jpl_36.csv",
        options.shared / "gtoc" / "official" / "GTOC7-DATA.txt",
    )
    method = "reference" if options.method == STARTED else options.method
    margins = solve(tour, method, options.workers).m0 / tour.m0
    reached = int((margins >= TARGET_MARGIN).sum())
    print(
        f"JPL's GTOC7 tour: m* >= {TARGET_MARGIN} m0 on {reached} of {len(tour)} legs; "
        f"m*/m0 least {margins.min():.4f}, median {np.median(margins):.3f}"
    )
    return 0 if share >= TARGET_SHARE and reached == len(tour) else 1


if __name__ == "__main__":
    sys.exit(main())
