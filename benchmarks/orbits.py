"""Time whole-catalogue propagation and neighbour queries, beside a loop over pykep planets.

    python benchmarks/orbits.py [--repeats 21]

Prints medians. The bodies are synthetic main belts of the sizes of the GTOC7
and GTOC11 tables; one thread throughout. The loop over pykep planets is timed
on a subsample, with the planets built beforehand.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

from feasibility.constants import MU_SUN
from feasibility.orbits import Catalogue, OrbitalNeighbours, synthetic_main_belt
from feasibility.runtime.pykep_guard import load_pykep

SIZES = {"GTOC7": 16_256, "GTOC11": 83_453}
PYKEP_BODIES = 2000
QUERIES, NEIGHBOURS = 1000, 60


def median_ms(call: Callable[[int], object], repeats: int) -> float:
    """Time `call(k)` for k = 0, 1, ...; one more call beforehand loads the kernels."""
    call(-1)
    seconds = []
    for k in range(repeats):
        start = time.perf_counter()
        call(k)
        seconds.append(time.perf_counter() - start)
    return 1e3 * statistics.median(seconds)


def pykep_loop(catalogue: Catalogue) -> Callable[[int], object]:
    """Return a call that asks one pykep planet after the other for its state."""
    pk = load_pykep()
    planets = [
        pk.planet(
            pk.udpla.keplerian(
                when=pk.epoch(epoch),
                elem=list(elements),
                mu_central_body=MU_SUN,
                el_type=pk.el_type.KEP_M,
            )
        )
        for epoch, elements in zip(catalogue.epoch_mjd2000, catalogue.elements, strict=True)
    ]
    return lambda k: [planet.eph(5000.0 + 10.0 * k) for planet in planets]


def report(what: str, milliseconds: float, count: int) -> None:
    print(f"{what:<52}{milliseconds:>12.2f}{1e3 * milliseconds / count:>12.3f}")


def measure(like: str, n: int, repeats: int) -> None:
    """Print the lines of one catalogue size."""
    belt = synthetic_main_belt(n, np.random.default_rng(0))
    ours = median_ms(lambda k: belt.states(5000.0 + 10.0 * k), repeats)
    report(f"propagate {n} bodies (as many as {like})", ours, n)

    sample = belt.select(np.arange(PYKEP_BODIES))
    theirs = median_ms(pykep_loop(sample), max(3, repeats // 4))
    report(f"loop over {PYKEP_BODIES} pykep planets", theirs, PYKEP_BODIES)
    print(f"{'  ratio a body':<52}{theirs / PYKEP_BODIES / (ours / n):>12.1f}")

    neighbours = OrbitalNeighbours(belt, bucket_days=1.0)
    # A new bucket each time: propagation, tree and the one query that asks for it.
    build = median_ms(lambda k: neighbours.query([0], 5000.0 + k, 1), repeats)
    report("propagate and build one KD-tree", build, n)
    rows = np.random.default_rng(1).integers(0, n, QUERIES)
    query = median_ms(lambda _: neighbours.query(rows, 5000.0, NEIGHBOURS), repeats)
    report(f"query {QUERIES} bodies x {NEIGHBOURS} neighbours", query, QUERIES)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--repeats", type=int, default=21, help="timed calls a line (default 21)")
    repeats = parser.parse_args().repeats
    print(f"{'what':<52}{'median ms':>12}{'us a body':>12}")
    for like, n in SIZES.items():
        measure(like, n, repeats)


if __name__ == "__main__":
    main()
