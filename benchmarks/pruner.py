"""Time pruners on candidates of a tour search, side by side in one run.

Run from the repository: python benchmarks/pruner.py [--legs N] [--threads 2]

The candidates are those of the protocol "search" in a synthetic main belt. For the classifier
there are fly-bys too, those of the protocol "flyby": any spacecraft, from any orbit past a
position, four in five at any speed, the others with a bound on it. Each
pruner gets them as legs, so its time is with features and everything. The classifier
shares its work out to threads itself; for the others the batch is split over threads, as their
kernels release the lock. pykep's mima2_from_hop, on a few of the legs, is given one leg at a
time; so is the network of the package neural_lowthrust, where that is installed.

Legs per second are by the wall clock, so that other work on the same cores makes them fewer;
the processor time of a leg depends less on that.
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
from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.constants import MU_SUN
from feasibility.dataset import read_protocol
from feasibility.evaluation.peers import NEURAL, known_peers
from feasibility.orbits import synthetic_main_belt
from feasibility.pruners import LambertPruner, Mima2Pruner, MimaPruner
from feasibility.pruners.classifier import ClassifierPruner
from feasibility.runtime.pykep_guard import load_pykep

REPEATS = 5
SINGLE_CALLS = 2000
OURS, PYKEP = "classifier, recall 0.99", "pykep mima2_from_hop"
FLY_BYS = "classifier, fly-bys"


def candidates(name: str, n: int) -> Legs:
    protocol = read_protocol(name)
    rng = np.random.default_rng(0)
    catalogue = synthetic_main_belt(16256, rng)
    craft = protocol.craft() if protocol.spacecraft else None
    return protocol.sampler.draw(n, rng, catalogue, craft, protocol.impulsive_grid).legs


def seconds(call: Callable[[], object], repeats: int = REPEATS) -> tuple[float, float]:
    """Return the least wall-clock and the least processor time of a call."""
    call()
    wall, processor = [], []
    for _ in range(repeats):
        clock, own = time.perf_counter(), time.process_time()
        call()
        wall.append(time.perf_counter() - clock)
        processor.append(time.process_time() - own)
    return min(wall), min(processor)


def split_calls(pruner: Pruner, legs: Legs, threads: int) -> Callable[[], object]:
    """Return a call of the pruner on parts of the batch, one a thread."""
    parts = [legs.take(rows) for rows in np.array_split(np.arange(len(legs)), threads)]

    def call() -> object:
        with ThreadPoolExecutor(threads) as pool:
            return list(pool.map(pruner.keep, parts))

    return call


def pykep_mima2(legs: Legs) -> Callable[[], object]:
    """Return a call of pykep's mima2_from_hop on every leg."""
    pykep = load_pykep()
    begin = pykep.epoch(0.0)
    hops = []
    for i in range(len(legs)):
        end = pykep.epoch(legs.tof_days[i])
        bodies = [
            pykep.planet(pykep.udpla.keplerian(epoch, [state[:3], state[3:]], MU_SUN))
            for epoch, state in ((begin, legs.rv_dep[i]), (end, legs.rv_arr[i]))
        ]
        hops.append((*bodies, begin, end, legs.thrust[i], legs.exhaust_velocity[i]))

    def call() -> None:
        for hop in hops:
            pykep.mima2_from_hop(*hop)

    return call


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--legs", type=int, default=100_000, help="candidates (default 100000)")
    parser.add_argument("--threads", type=int, default=2, help="threads (default 2)")
    parser.add_argument("--model", default="default", help="model file (default: the package's)")
    options = parser.parse_args()
    legs, fly_bys = candidates("search", options.legs), candidates("flyby", options.legs)
    few = legs.take(np.arange(min(SINGLE_CALLS, len(legs))))
    classifier = FeasibilityClassifier.load(options.model)
    pruner = ClassifierPruner(classifier, recall=0.99, threads=options.threads)
    print(
        f"{len(legs)} candidates, {options.threads} threads; the classifier keeps "
        f"{pruner.keep(legs).mean():.3f} of them, and {pruner.keep(fly_bys).mean():.3f} of as "
        "many fly-bys"
    )
    print(f"{'':<26} {'legs/s':>10} {'us a leg':>10}")
    calls = {
        OURS: (lambda: pruner.keep(legs), legs),
        FLY_BYS: (lambda: pruner.keep(fly_bys), fly_bys),
    }
    for name, other in (
        ("lambert", LambertPruner()),
        ("mima", MimaPruner()),
        ("mima2", Mima2Pruner()),
    ):
        calls[name] = split_calls(other, legs, options.threads), legs
    calls[PYKEP] = pykep_mima2(few), few
    peers, missing = known_peers()
    for peer in peers:
        if peer.name == NEURAL:
            calls[NEURAL] = (lambda score=peer.score: score(few)), few
    rates, used = {}, {}
    for name, (call, asked) in calls.items():
        wall, processor = seconds(call)
        rates[name], used[name] = len(asked) / wall, processor / len(asked)
        print(f"{name:<26} {rates[name]:>10.0f} {1e6 * used[name]:>10.2f}", flush=True)
        if name == FLY_BYS:
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(f"  peak memory so far {peak:.0f} MB")
    for name in (PYKEP, NEURAL):
        if name in used:
            print(
                f"{OURS}: {rates[OURS] / rates[name]:.1f} times the legs per second of {name}, "
                f"{used[name] / used[OURS]:.1f} times as many in the same processor time"
            )
    if missing:
        print(missing)


if __name__ == "__main__":
    main()
