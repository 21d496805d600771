"""Time the batch kernels against pykep, side by side in one run on one core.

Run from the repository: python benchmarks/kernels.py [--legs N]

pykep's figures include its Python call, since that is how a program meets it.
The legs lie between neighbours of a synthetic main belt.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

from feasibility.constants import DAY_S, MU_SUN
from feasibility.orbits import classical_to_cartesian, synthetic_main_belt
from feasibility.orbits.kepler_kernels import propagate_batch, propagate_stm_batch
from feasibility.orbits.lambert import lambert
from feasibility.orbits.mima import mima2_branches, mima_branches
from feasibility.runtime.pykep_guard import load_pykep

THRUST, EXHAUST = 0.3, 30000.0
REPEATS = 7


def median_us(call: Callable[[], object], count: int) -> float:
    call()
    samples = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        call()
        samples.append(time.perf_counter() - start)
    return statistics.median(samples) / count * 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--legs", type=int, default=2000, help="number of legs (default 2000)")
    n = parser.parse_args().legs
    pk = load_pykep()
    rng = np.random.default_rng(0)
    departure = classical_to_cartesian(synthetic_main_belt(n, rng).elements)
    tof = rng.uniform(60.0, 900.0, n) * DAY_S
    # Arrival: the coasted departure state, nudged, as a search's neighbours are.
    arrival = propagate_batch(departure, tof, MU_SUN) * (1.0 + 0.05 * rng.normal(size=(n, 6)))
    dep = [(row[:3], row[3:]) for row in departure]
    pairs = list(zip(departure[:, :3], arrival[:, :3], tof, strict=True))

    rows: list[tuple[str, float, float]] = []
    for label, kernel, stm in (
        ("Kepler", propagate_batch, False),
        ("Kepler + transition matrix", propagate_stm_batch, True),
    ):
        ours = median_us(lambda k=kernel: k(departure, tof, MU_SUN), n)
        theirs = median_us(
            lambda s=stm: [
                pk.propagate_lagrangian(rv, t, MU_SUN, s) for rv, t in zip(dep, tof, strict=True)
            ],
            n,
        )
        rows.append((label, ours, theirs))
    for revs in (0, 2):
        v1, _ = lambert(departure[:, :3], arrival[:, :3], tof, revs)
        solutions = int(np.isfinite(v1[:, :, 0]).sum())
        ours = median_us(
            lambda r=revs: lambert(departure[:, :3], arrival[:, :3], tof, r), solutions
        )
        theirs = median_us(
            lambda r=revs: [
                pk.lambert_problem(r1, r2, t, MU_SUN, False, r) for r1, r2, t in pairs
            ],
            solutions,
        )
        rows.append((f"Lambert up to {revs} revolutions, a solution", ours, theirs))

    epochs = [(pk.epoch(0.0), pk.epoch(t / DAY_S)) for t in tof]
    planets = []
    for start, end, (t0, t1) in zip(departure, arrival, epochs, strict=True):
        planets.append(
            (
                pk.planet(pk.udpla.keplerian(t0, [start[:3], start[3:]], MU_SUN)),
                pk.planet(pk.udpla.keplerian(t1, [end[:3], end[3:]], MU_SUN)),
            )
        )
    for label, branches, from_hop in (
        ("MIMA of a hop, Lambert included", mima_branches, pk.mima_from_hop),
        ("MIMA2 of a hop, Lambert included", mima2_branches, pk.mima2_from_hop),
    ):
        ours = median_us(
            lambda b=branches: b(departure, arrival, tof, THRUST, EXHAUST, max_revs=0), n
        )
        theirs = median_us(
            lambda f=from_hop: [
                f(a, b, t0, t1, THRUST, EXHAUST)
                for (a, b), (t0, t1) in zip(planets, epochs, strict=True)
            ],
            n,
        )
        rows.append((label, ours, theirs))

    print(f"{n} legs, one core, medians of {REPEATS}, microseconds each")
    print(f"{'':42}{'batch':>9}{'pykep':>9}{'ratio':>8}")
    for label, ours, theirs in rows:
        print(f"{label:42}{ours:9.2f}{theirs:9.2f}{theirs / ours:7.1f}x")


if __name__ == "__main__":
    main()
