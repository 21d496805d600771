"""Time the reading of a full-size MPCORB table, with and without the cache, and its memory.

    python benchmarks/tables.py [--bodies 1500000] [--seed 0] [--keep FILE]

Writes a synthetic table in the format of MPCORB.DAT and reads it in processes of their own, each
with one thread and a cache folder of its own. Prints seconds and the peak of the resident memory.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

LETTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
SELECT = "a > 2.2 and e < 0.2 and H < 16"

CHILD = """
import resource, sys, time
from feasibility.orbits import read_catalogue
start = time.perf_counter()
catalogue = read_catalogue(sys.argv[1], select=sys.argv[2] or None)
seconds = time.perf_counter() - start
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(f"{seconds:.2f} {peak:.0f} {len(catalogue)}")
"""


def packed_number(number: int) -> str:
    if number < 620_000:
        return f"{LETTERS[number // 10_000]}{number % 10_000:04d}"
    text, rest = "", number - 620_000
    for _ in range(4):
        text, rest = LETTERS[rest % 62] + text, rest // 62
    return "~" + text


def write_mpcorb(path: Path, bodies: int, rng: np.random.Generator) -> None:
    """Write a belt of which three in five bodies are numbered, as in the real table."""
    numbered = 3 * bodies // 5
    a = rng.uniform(2.1, 3.3, bodies)
    columns = (
        rng.uniform(8.0, 20.0, bodies),
        *(rng.uniform(0.0, 360.0, bodies) for _ in range(3)),
        np.degrees(rng.rayleigh(0.12, bodies)).clip(0.0, 60.0),
        rng.rayleigh(0.1, bodies).clip(0.0, 0.6),
        0.9856076686 / a**1.5,
        a,
    )
    with path.open("w") as file:
        file.write("MINOR PLANET CENTER ORBIT DATABASE (synthetic)\n\n" + 160 * "-" + "\n")
        for k, (h, *orbit) in enumerate(zip(*(x.tolist() for x in columns), strict=True)):
            if k < numbered:
                packed, name = packed_number(k + 1), f"({k + 1})"
            else:
                order = k - numbered
                cycle, half = divmod(order, 25 * 24)
                year, cycle = divmod(cycle, 600)
                first, second = divmod(half, 25)
                one = "ABCDEFGHJKLMNOPQRSTUVWXY"[first]
                two = "ABCDEFGHJKLMNOPQRSTUVWXYZ"[second]
                packed = f"K{year:02d}{one}{LETTERS[cycle // 10]}{cycle % 10}{two}"
                name = f"        20{year:02d} {one}{two}{cycle or ''}"
            m, argp, node, i, e, n, axis = orbit
            file.write(
                f"{packed:7} {h:5.2f} {0.15:5.2f} K25BL {m:9.5f}  {argp:9.5f}  {node:9.5f}  "
                f"{i:9.5f}  {e:9.7f} {n:11.8f} {axis:11.7f}  0 E2025-X00  1234  12 1990-2025 "
                f"0.50 M-v 3Ek MPCLINUX   0000 {name:28}20251120\n"
            )


def timed(path: Path, cache: Path, select: str = "") -> tuple[str, str, str]:
    """Read in a process of its own; return seconds, MiB and bodies."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(path), select],
        env={**os.environ, **threads, "XDG_CACHE_HOME": str(cache)},
        check=True,
        capture_output=True,
        text=True,
    )
    seconds, peak, bodies = done.stdout.split()
    return seconds, peak, bodies


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, default=1_500_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="where the table is kept")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = options.keep or Path(folder) / "MPCORB.DAT"
        start = time.perf_counter()
        write_mpcorb(path, options.bodies, np.random.default_rng(options.seed))
        seconds = time.perf_counter() - start
        size = path.stat().st_size / 1e6
        print(f"{options.bodies} bodies, {size:.0f} MB, written in {seconds:.0f} s")
        cache = Path(folder) / "cache"
        print(f"select: {SELECT}")
        print(f"{'':<34}{'s':>8}{'MiB':>8}{'bodies':>10}")
        for what, select in (
            ("read, and written to the cache", ""),
            ("from the cache", ""),
            ("from the cache, those selected", SELECT),
        ):
            took, peak, bodies = timed(path, cache, select)
            print(f"{what:<34}{took:>8}{peak:>8}{bodies:>10}")


if __name__ == "__main__":
    main()
