"""Time pruners on candidates of a tour search, side by side in one run.

Run from the repository: python benchmarks/pruner.py [--legs N] [--threads 2]

The candidates are those of the protocol "search" in a synthetic main belt. Each
pruner gets them as legs, so its time is with features and everything; the
kernels and BLAS release the lock, so the batch is split over threads.
pykep's mima2, one leg at a time on a few of them and on one core, is given
its Lambert arc, so its time is without that. Times are by the wall clock: other work on the
same cores makes all of them longer.
"""

import argparse
import os
import resource
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

# One BLAS thread a thread of ours; to be set before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from feasibility import Legs, Pruner
from feasibility.classifier import FeasibilityClassifier
from feasibility.constants import MU_SUN
from feasibility.dataset import read_protocol
from feasibility.orbits import synthetic_main_belt
from feasibility.pruners import LambertPruner, Mima2Pruner, MimaPruner
from feasibility.pruners.classifier import ClassifierPruner
from feasibility.pykep_guard import load_pykep

REPEATS = 5
SINGLE_CALLS = 2000


def candidates(n: int) -> Legs:
    protocol = read_protocol("search")
    rng = np.random.default_rng(0)
    catalogue = synthetic_main_belt(16256, rng)
    return protocol.sampler.draw(n, rng, catalogue, protocol.craft(), protocol.impulsive_grid).legs


def seconds(call: Callable[[], object]) -> float:
    call()
    best = np.inf
    for _ in range(REPEATS):
        start = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - start)
    return best


def rate(pruner: Pruner, legs: Legs, threads: int) -> tuple[float, float]:
    """Return legs per second and the share kept."""
    parts = [legs.take(rows) for rows in np.array_split(np.arange(len(legs)), threads)]
    with ThreadPoolExecutor(threads) as pool:
        kept = np.concatenate(list(pool.map(pruner.keep, parts)))
        elapsed = seconds(lambda: list(pool.map(pruner.keep, parts)))
    return len(legs) / elapsed, float(kept.mean())


def pykep_mima2_rate(legs: Legs) -> float:
    """Return legs per second of pykep's mima2_from_hop on one core."""
    pykep = load_pykep()
    n = min(SINGLE_CALLS, len(legs))
    problems = []
    for i in range(n):
        lambert = pykep.lambert_problem(
            legs.rv_dep[i, :3], legs.rv_arr[i, :3], legs.tof_s[i], MU_SUN, False, 0
        )
        v1, v2 = np.array(lambert.v0[0]), np.array(lambert.v1[0])
        state = [legs.rv_dep[i, :3].tolist(), v1.tolist()]
        impulses = [(v1 - legs.rv_dep[i, 3:]).tolist(), (legs.rv_arr[i, 3:] - v2).tolist()]
        problems.append(
            (state, *impulses, legs.tof_s[i], legs.thrust[i], legs.exhaust_velocity[i])
        )

    def call() -> None:
        for problem in problems:
            pykep.mima2(*problem, MU_SUN)

    return n / seconds(call)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--legs", type=int, default=100_000, help="candidates (default 100000)")
    parser.add_argument("--threads", type=int, default=2, help="threads (default 2)")
    parser.add_argument("--model", default="default", help="model file (default: the package's)")
    options = parser.parse_args()
    legs = candidates(options.legs)
    classifier = FeasibilityClassifier.load(options.model)
    pruners: dict[str, Pruner] = {
        "classifier, recall 0.99": ClassifierPruner(classifier, recall=0.99),
        "lambert": LambertPruner(),
        "mima": MimaPruner(),
        "mima2": Mima2Pruner(),
    }
    print(f"{len(legs)} candidates, {options.threads} threads")
    for name, pruner in pruners.items():
        per_second, kept = rate(pruner, legs, options.threads)
        print(f"{name:<26} {per_second:>10.0f} legs/s   keeps {kept:.3f}")
    print(f"{'pykep mima2 (1 core)':<26} {pykep_mima2_rate(legs):>10.0f} legs/s")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory {peak:.0f} MB")


if __name__ == "__main__":
    main()
