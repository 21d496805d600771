"""Fast leg solver against the reference: the same legs, one core, one run.

For each family of legs (table1, search, near-Earth; with free ends flyby, launch, launch-flyby,
arrival, general-ends) it prints

- ms a leg of the fast solver and of the reference with all its starts, and their ratio;
- ms of one more start of each (random starts, in excess of the leg without), and their ratio;
- the share of legs whose m* is within 0.2 % of the reference's or larger, worse by
  more than 0.5 %, better by more than 0.2 %; where there are legs whose reference solution
  no spacecraft flies (`burns_nearly_everything`), once more without them;
- the shares of equal labels (m0 <= m*) among all legs, where one that a solver does not solve
  counts as too heavy, and among those that both solve;
- the shares of legs that the fast solver cannot confirm, which would fall back, that the
  reference cannot, and that neither can;
- label noise: the share of labels (m0 <= m*) that 20 more random starts flip;
- minimum propellant at 0.6 to 1 times m*: ms a leg, ratio, and the share within 0.2 %
  of the reference's propellant or less.

Run from the root of the checkout; the official tables are read from `--tables`,
without them a synthetic belt stands in for all:

    python benchmarks/leg_solver.py                        # some minutes
    python benchmarks/leg_solver.py --legs 300 --noise-legs 1000
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs, Spacecraft
from feasibility.dataset import read_protocol
from feasibility.dataset.samplers.any_spacecraft import AnySpacecraft
from feasibility.dataset.samplers.free_ends import FreeEnds
from feasibility.dataset.samplers.impulsive import ImpulsiveGrid
from feasibility.dataset.samplers.random_pairs import RandomPairs
from feasibility.dataset.samplers.search_candidates import SearchCandidates
from feasibility.orbits import Catalogue, read_catalogue, synthetic_main_belt
from feasibility.sims_flanagan.fast.solver import fast_max_initial_mass, fast_min_propellant
from feasibility.sims_flanagan.reference.solver import (
    reference_max_initial_mass,
    reference_min_propellant,
)
from feasibility.sims_flanagan.solutions import LegSolutions

NEXT = Spacecraft(m_dry=1000.0, thrust=0.236, isp=4190.0)
GTOC7_PROBE = Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0)
FREE_ENDS = ("flyby", "launch", "launch-flyby", "arrival", "general-ends")
MORE_STARTS = 4
NOISE_STARTS = 20
LEAST_SHARE = 0.0501


def table(folder: Path, name: str) -> Catalogue:
    """Return an official table, or a synthetic belt with a note."""
    path = folder / name
    if path.exists():
        return read_catalogue(path)
    print(f"{path} is not here: a synthetic belt stands in for it")
    return synthetic_main_belt(16256, np.random.default_rng(0))


def families(folder: Path) -> dict[str, Callable[[int, np.random.Generator], Legs]]:
    """Return the sampler of each family."""
    belt, near_earth = table(folder, "GTOC7-DATA.txt"), table(folder, "GTOC5-DATA.txt")
    grid = ImpulsiveGrid()
    similar = RandomPairs(max_de=0.15, max_di_deg=8.0)
    return {
        "table1": lambda n, rng: RandomPairs().draw(n, rng, belt, NEXT, grid).legs,
        "search": lambda n, rng: SearchCandidates().draw(n, rng, belt, GTOC7_PROBE, grid).legs,
        "near-Earth": lambda n, rng: similar.draw(n, rng, near_earth, NEXT, grid).legs,
    } | {name: near_boundary(name, belt) for name in FREE_ENDS}


def near_boundary(name: str, belt: Catalogue) -> Callable[[int, np.random.Generator], Legs]:
    """Return the sampler of a protocol with free ends; two masses in five are near m*."""
    if name == "general-ends":
        ends = FreeEnds(departures=0.5, arrivals=0.5, any_speed=0.3)
        sampler: Any = AnySpacecraft(free_ends=ends)
    else:
        sampler = read_protocol(name).sampler

    def draw(n: int, rng: np.random.Generator) -> Legs:
        legs: Legs = sampler.draw(n, rng, belt, None, ImpulsiveGrid()).legs
        heaviest = fast_max_initial_mass(legs).m0
        near = heaviest * np.exp(rng.normal(0.0, 0.1, n))
        chosen = (rng.uniform(size=n) < 0.4) & (near < 1e6) & (near > 101.0 * legs.thrust)
        return legs.with_m0(np.maximum(np.where(chosen, near, legs.m0), legs.m_dry))

    return draw


def timed(solve: Callable[..., Any], legs: Legs, **options: Any) -> tuple[Any, float]:
    """Return what a solver found and its milliseconds of processor time a leg."""
    began = time.process_time()
    found = solve(legs, **options)
    return found, 1e3 * (time.process_time() - began) / len(legs)


def maximum_mass(name: str, legs: Legs) -> None:
    """Print the comparison of the two maximum-initial-mass solvers."""
    fast, fast_ms = timed(fast_max_initial_mass, legs)
    _, fast_more = timed(fast_max_initial_mass, legs, extra_random_starts=MORE_STARTS)
    reference, reference_ms = timed(reference_max_initial_mass, legs)
    _, one_ms = timed(reference_max_initial_mass, legs, agreement=1)
    _, one_more = timed(
        reference_max_initial_mass,
        legs,
        agreement=1,
        n_random=MORE_STARTS,
        rng=np.random.default_rng(0),
    )
    fast_start = (fast_more - fast_ms) / MORE_STARTS
    reference_start = (one_more - one_ms) / MORE_STARTS
    median = 1e3 * np.median(reference.seconds)
    solved = fast.converged & reference.converged
    labels = (fast.m0 >= legs.m0) == (reference.m0 >= legs.m0)
    thrustless = np.isinf(reference.m0) | np.isinf(fast.m0)
    both = np.isinf(reference.m0) & np.isinf(fast.m0)
    known = reference.converged & ~thrustless
    unreal = known & burns_nearly_everything(legs, reference)
    without = (
        f"  {unreal.sum()} of the reference's burn more than 1 - 1/e of the mass in one impulse; "
        f"without them\n  {agreement(fast, reference, known & ~unreal)}\n"
        if unreal.any()
        else ""
    )
    print(
        f"{name}: {len(legs)} legs\n"
        f"  a leg      fast {fast_ms:8.2f} ms   reference {reference_ms:8.1f} ms "
        f"(median {median:.1f})   ratio {reference_ms / fast_ms:6.0f}\n"
        f"  a start    fast {fast_start:8.2f} ms   reference {reference_start:8.1f} ms"
        f"   ratio {reference_start / fast_start:6.0f}\n"
        f"  {agreement(fast, reference, known)}   labels equal {labels.mean():.4f}, "
        f"of legs that both solve {labels[solved].mean():.4f}\n"
        f"{without}"
        f"  no thrust needed: fast {np.isinf(fast.m0).mean():.4f}, "
        f"reference {np.isinf(reference.m0).mean():.4f}, both {both.mean():.4f}\n"
        f"  not confirmed: fast {np.mean(~fast.converged):.4f}, "
        f"reference {np.mean(~reference.converged):.4f}, "
        f"both {np.mean(~fast.converged & ~reference.converged):.4f}"
    )


def agreement(fast: LegSolutions, reference: LegSolutions, rows: NDArray[np.bool_]) -> str:
    """Return in words how the m* of some rows agree."""
    gain = fast.m0[rows] / reference.m0[rows] - 1.0
    return (
        f"m* of {len(gain)} legs within 0.2 % or better {np.mean(gain > -0.002):.4f}   "
        f"worse by > 0.5 % {np.mean(gain < -0.005):.4f}   "
        f"better by > 0.2 % {np.mean(gain > 0.002):.4f}"
    )


def burns_nearly_everything(legs: Legs, solutions: LegSolutions) -> NDArray[np.bool_]:
    """Tell where an impulse of the backward half exceeds the exhaust velocity.

    With free ends also where hardly more than the reference's least share of the mass is left.

    Such an impulse leaves less than 1/e of the mass. pykep's convention allows it, with the
    thrust over the mass that is left (docs/guide/solver.md); the fast solver does not look there.
    """
    n = solutions.n_segments
    mass = solutions.m_final.copy()
    found = legs.free_ends & (solutions.m_final < LEAST_SHARE * solutions.m0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for throttle in np.linalg.norm(solutions.throttles, axis=2).T[: n // 2 - 1 : -1]:
            impulse = legs.thrust * throttle * legs.tof_s / n / mass / legs.exhaust_velocity
            found |= impulse > 1.0
            mass = mass * np.exp(impulse)
    return found


def label_noise(legs: Legs) -> None:
    """Print how many labels change with more random starts."""
    first = fast_max_initial_mass(legs).m0
    more = fast_max_initial_mass(
        legs, extra_random_starts=NOISE_STARTS, rng=np.random.default_rng(99)
    ).m0
    flipped = (first >= legs.m0) != (more >= legs.m0)
    with np.errstate(invalid="ignore"):
        raised = more / first > 1.002
    print(
        f"  label noise: {NOISE_STARTS} more starts flip {flipped.mean():.4f} of {len(legs)} "
        f"labels, raise {raised.mean():.4f} of the m* by > 0.2 %"
    )


def propellant(legs: Legs, rng: np.random.Generator) -> None:
    """Print the comparison of the two minimum-propellant solvers."""
    best = fast_max_initial_mass(legs)
    some = best.converged & np.isfinite(best.m0) & (0.6 * best.m0 > 101.0 * legs.thrust)
    legs, best = legs.take(some), best.take(some)
    m0 = rng.uniform(0.6, 1.0, len(legs)) * best.m0
    legs = Legs(
        *(legs.rv_dep, legs.rv_arr, legs.tof_days, m0, legs.thrust, legs.isp, 0.0),
        vinf_dep=legs.vinf_dep,
        vinf_arr=legs.vinf_arr,
    )
    fast, fast_ms = timed(fast_min_propellant, legs, guess=best)
    reference, reference_ms = timed(reference_min_propellant, legs, guess=best)
    both = fast.converged & reference.converged
    used = (fast.m0 - fast.m_final)[both] / (reference.m0 - reference.m_final)[both] - 1.0
    print(
        f"  minimum propellant: fast {fast_ms:.2f} ms, reference {reference_ms:.0f} ms a leg, "
        f"ratio {reference_ms / fast_ms:.0f}; within 0.2 % or less {np.mean(used < 0.002):.4f}; "
        f"worst {used.max():+.4f}; not confirmed {np.mean(~fast.converged):.4f}, "
        f"reference {np.mean(~reference.converged):.4f}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tables", type=Path, default=Path("../shared/gtoc/official"))
    parser.add_argument("--legs", type=int, default=60, help="legs a family against the reference")
    parser.add_argument("--noise-legs", type=int, default=300, help="legs a family, label noise")
    parser.add_argument("--seed", type=int, default=1)
    families_known = ("table1", "search", "near-Earth", *FREE_ENDS)
    parser.add_argument("--family", choices=families_known, action="append")
    arguments = parser.parse_args()
    for name, draw in families(arguments.tables).items():
        if arguments.family and name not in arguments.family:
            continue
        rng = np.random.default_rng(arguments.seed)
        legs = draw(max(arguments.legs, arguments.noise_legs), rng)
        few = legs.take(np.arange(arguments.legs))
        # Compilation and pykep's import belong to nobody.
        warm = few.take([0])
        fast_min_propellant(warm.with_m0(warm.m_dry))
        reference_max_initial_mass(warm, agreement=1)
        maximum_mass(name, few)
        label_noise(legs.take(np.arange(arguments.noise_legs)))
        propellant(few, rng)


if __name__ == "__main__":
    main()
