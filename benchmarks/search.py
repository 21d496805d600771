"""What a pruner buys: the same search with several pruners, one after the other in one run.

Run from the repository: python benchmarks/search.py --catalogue GTOC7-DATA.txt
[--time-limit 2min | --beam-width 50] [--seed 0] [--workers 2] [--out FILE.json]

Problem, seed and wall-clock budget are the same for all. With a classifier the search sends
out scouts and chooses flight times by its answers; with the other pruners it proposes a fixed
grid of flight times and optimises all that survive, for each pair from the shortest until two
can be flown. Without a pruner that takes so many optimisations that the beam is kept to
--unpruned-width nodes, or no pass would come to its end. The false-prune rate is that of the
audit, the same for all: legs are sorted by the default model, and optimised by the solver of the
search. "for N" is how many legs had been optimised when the tour first had as many asteroids as
without pruning at the end.
Times are by the wall clock: other work on the same cores makes all runs shorter of breath.
With --beam-width instead of a time limit, nothing but the seconds depends on the machine.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.runtime.atomic import write_text
from feasibility.runtime.provenance import provenance
from feasibility.runtime.workers import default_workers, worker_pool
from feasibility.sims_flanagan.fast.compilation import (
    compile_kernels,
    prefer_fast_compilation,
    sample_leg,
)
from seqsearch.beam.beam_search import search
from seqsearch.beam.state import SearchState
from seqsearch.commands.options import parse_duration
from seqsearch.core.problem import Problem
from seqsearch.problems.problem_file import build_problem, read_config, with_catalogue
from seqsearch.pruning.audit_estimate import AuditEstimate
from seqsearch.pruning.pruner_spec import parse_pruner
from seqsearch.settings import SearchSettings
from seqsearch.tours.verify import verify_tour

UNPRUNED = "none"
ALL = 10**9
PRUNERS = (UNPRUNED, "lambert:1.3", "mima2:0.97", "default:0.99", "default:1")


@dataclass(kw_only=True)
class Row:
    """One run; `steps` has the legs optimised and the asteroids reached after each rank."""

    pruner: str
    asteroids: int
    verified: bool
    proposed: int
    optimised: int
    feasible: int
    seconds: float
    audit: AuditEstimate | None
    steps: list[tuple[int, int]]

    def optimised_until(self, asteroids: int) -> int | None:
        """Return the legs optimised until there were that many asteroids; None if never."""
        return next((solves for solves, reached in self.steps if reached >= asteroids), None)


def run(
    problem: Problem, settings: SearchSettings, pruner: str, options: argparse.Namespace
) -> Row:
    steps: list[tuple[int, int]] = []

    def on_rank(state: SearchState) -> None:
        steps.append((sum(r.optimised for r in state.counters), state.best_key[0] + 1))

    settings = settings.with_(pruner=pruner, solves_per_rank=ALL)
    if pruner == UNPRUNED and not options.beam_width:
        settings = settings.with_(max_beam_width=options.unpruned_width)
    parsed = parse_pruner(pruner)
    parsed.keep(sample_leg())
    with worker_pool(options.workers) as pool:
        if pool is not None:
            for future in [pool.submit(compile_kernels) for _ in range(options.workers)]:
                future.result()
        began = time.perf_counter()
        result = search(
            problem,
            pruner=parsed,
            audit_predictor=FeasibilityClassifier.load(),
            settings=settings,
            rng=np.random.default_rng(options.seed),
            executor=pool,
            threads=options.workers,
            time_limit_s=None if options.beam_width else parse_duration(options.time_limit),
            on_rank=on_rank,
        )
        seconds = time.perf_counter() - began
    audits = [record.audit for record in result.counters if record.audit is not None]
    return Row(
        pruner=pruner,
        asteroids=result.tour.n_asteroids,
        verified=verify_tour(result.tour).passed,
        proposed=sum(record.proposed for record in result.counters),
        optimised=sum(record.optimised for record in result.counters),
        feasible=sum(record.feasible for record in result.counters),
        seconds=seconds,
        audit=AuditEstimate.of(audits) if audits else None,
        steps=steps,
    )


def line(row: Row, unpruned: Row) -> str:
    until = row.optimised_until(unpruned.asteroids)
    ratio = f"{unpruned.optimised / until:.0f} x fewer" if until else "-"
    share = f"{100 * row.feasible / row.optimised:.1f} %" if row.optimised else "-"
    audit = "-"
    if row.audit is not None:
        low, high = (100 * limit for limit in row.audit.interval)
        audit = f"{100 * row.audit.false_prune_rate:.2f} ({low:.2f} to {high:.2f}) %"
    return (
        f"{row.pruner:<13} {row.asteroids:>9} {'yes' if row.verified else 'NO':>8} "
        f"{row.proposed:>11} {row.optimised:>9} {share:>8} {row.seconds:>7.0f}  {audit:<26} "
        f"{until if until else '-':>8}  {ratio}"
    )


def main() -> None:
    prefer_fast_compilation()
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--catalogue", required=True, help="GTOC7-DATA.txt")
    parser.add_argument("--problem", default="gtoc7")
    parser.add_argument("--time-limit", default="2min", help="of each run")
    parser.add_argument("--beam-width", type=int, help="one pass so wide, without a time limit")
    parser.add_argument(
        "--unpruned-width", type=int, default=15, help="widest beam without a pruner (default 15)"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=default_workers())
    parser.add_argument("--pruners", nargs="+", default=PRUNERS, help="the first is the measure")
    parser.add_argument("--out", type=Path, help="also write the figures as JSON")
    options = parser.parse_args()
    config = with_catalogue(read_config(options.problem), options.catalogue)
    settings, budget = config.search, f"{options.time_limit} each"
    if options.beam_width:
        settings, budget = settings.with_(beam_width=options.beam_width), "one pass each"
    problem = build_problem(config)
    compile_kernels()
    rows: list[Row] = []
    for pruner in options.pruners:
        rows.append(run(problem, settings, pruner, options))
        if len(rows) == 1:
            print(
                f"{problem.name}, {problem.catalogue.source}, seed {options.seed}, "
                f"{budget}, {options.workers} workers\n"
                f"{'pruner':<13} asteroids verified {'proposed':>11} optimised flyable  seconds  "
                f"{'flyable legs pruned (95 %)':<26} {f'for {rows[0].asteroids}':>8}"
            )
        print(line(rows[-1], rows[0]), flush=True)
    if options.out is not None:
        record = provenance() | {"runs": rows}
        write_text(options.out, msgspec.json.format(msgspec.json.encode(record)).decode() + "\n")


if __name__ == "__main__":
    main()
