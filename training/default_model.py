"""Make the default model: generate its legs, train it, judge it on fresh legs.

Run from the root of the checkout, with the folder `shared` beside it. A leg takes 1 to 5 ms of
processor time, the training some ten minutes; every step goes on where it was
interrupted, and --share makes a smaller model of the same kind:

    python training/default_model.py --out data/default [--share 0.1] [--workers 2]

1. Legs with m* of all families: `FAMILIES`; the margin nets learn from them. Legs with free ends
   have nets of their own, which change nothing for the others (training/join_models.py takes
   them from one model into another).
2. With --hard-rounds N, N times: legs that the last model is most unsure of among several
   times as many (`HARD`), and a training with them too. Not part of the default model, as
   docs/guide/classifier.md says why.
3. Legs with minimum propellant: `final_mass_legs.LEGS`; the nets for the final mass learn from
   them.

With --margin-model FILE the first two steps are left out, and only the net for the final mass
is made.

The families are those of docs/guide/classifier.md. Seeds of training and test differ, and test
legs have the natural mix of their protocol, without draws at the boundary.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import msgspec
from final_mass_legs import (
    FRESH_SEED,
    LEGS,
    SEED,
    TEST_LEGS,
    TESTS,
    final_mass_protocol,
    fresh_protocol,
)

from feasibility.commands.cli import main as feasibility
from feasibility.dataset import read_protocol
from feasibility.dataset.generate import begin
from feasibility.dataset.protocol import Protocol, SpacecraftTable
from feasibility.dataset.samplers.free_ends import FreeEnds
from feasibility.learning.margin.hard_examples import harder
from feasibility.runtime.workers import worker_pool

TRAINING_SEED, TEST_SEED = 11, 7001
HARD_SEED = 101
LEGS_PER_SHARD = 1000
# Family: (legs for training, legs for the test).
FAMILIES = {
    "search": (120_000, 20_000),
    "table1": (93_000, 10_000),
    "nea": (140_000, 10_000),
    "neaall": (16_000, 0),
    "general": (130_000, 10_000),
    "craft1500": (14_000, 0),
    "craft2100": (8_000, 3_000),
    "craft2900": (11_000, 0),
    "craft3900": (8_000, 3_000),
    "craft5000": (8_000, 0),
    "nearby": (40_000, 10_000),
    "launch": (40_000, 10_000),
    "arrival": (25_000, 10_000),
    "launch-flyby": (40_000, 10_000),
    "flyby": (90_000, 10_000),
    "flyby-nea": (15_000, 3_000),
    "free": (20_000, 3_000),
}
# Family: what differs from the protocol like which its legs are drawn.
DIFFERING: dict[str, dict[str, Any]] = {
    "nearby": {"tof_days": (60.0, 600.0), "long_share": 0.0, "neighbours": 100},
    "flyby-nea": {
        "a_au": (0.7, 1.8),
        "catalogue_share": 0.5,
        "revolutions": (0.08, 0.8),
        "free_ends": FreeEnds(arrivals=1.0, any_speed=0.9, excess_of_circular=(0.02, 0.3)),
    },
    "free": {"free_ends": FreeEnds(departures=0.6, arrivals=0.6, any_speed=0.4)},
}
# Family: legs of a round of hard examples, the most doubtful of HARD_FACTOR times as many.
HARD = {"search": 12_000, "table1": 9_000, "nea": 14_000}
HARD_FACTOR = 5
# Of fewer legs with free ends there is not one batch to learn from.
LEAST_SHARE = 0.006
NEAR_EARTH = {"nea": "limited", "neaall": "table1", "nearby": "search", "flyby-nea": "flyby"}


def protocol(family: str, tables: Path) -> Protocol:
    """Return the protocol of a family: a built-in one on an official table, masses only.

    craftN: random pairs like table1, with an engine of N s and flight times over a wider range.
    nearby: neighbours near the Earth, flights of 60 to 600 days. flyby-nea: fly-bys there. free:
    general, with excess velocities at one end or both.
    """
    table = "GTOC5-DATA.txt" if family in NEAR_EARTH else "GTOC7-DATA.txt"
    isp = family.removeprefix("craft") if family.startswith("craft") else None
    base = "table1" if isp else "general" if family == "free" else NEAR_EARTH.get(family, family)
    made = read_protocol(base).with_catalogue(str(tables / table))
    changes: dict[str, Any] = {
        "name": family,
        "propellant": False,
        "legs_per_shard": LEGS_PER_SHARD,
    }
    differing = DIFFERING.get(family)
    if differing:
        changes["sampler"] = msgspec.structs.replace(made.sampler, **differing)
    if isp:
        sampler = msgspec.structs.replace(made.sampler, tof_ratio=(0.4, 3.0))
        craft = SpacecraftTable(dry_mass_kg=1000.0, thrust_n=0.236, isp_s=float(isp))
        changes |= {"sampler": sampler, "spacecraft": craft}
    return msgspec.structs.replace(made, **changes)


def generate(made: Protocol, legs: int, folder: Path, seed: int, workers: int) -> None:
    """Make or complete one dataset."""
    generation = begin(made, legs, folder, seed=seed)
    print(f"{folder}: {generation.legs_missing} of {legs} legs to make", flush=True)
    with worker_pool(workers) as pool:
        generation.run(pool, in_flight=2 * workers)


def natural(made: Protocol) -> Protocol:
    """Return the protocol without draws at the boundary."""
    return msgspec.structs.replace(made, boundary_share=0.0)


def main() -> int:
    """Do everything and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("data/default"), help="folder")
    parser.add_argument(
        "--share", type=float, default=1.0, help=f"of the legs (default 1, at least {LEAST_SHARE})"
    )
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--epochs", default="34", help="of the training (default 34)")
    parser.add_argument("--hard-rounds", type=int, default=0, help="of hard examples (default 0)")
    parser.add_argument("--margin-model", type=Path, help="keep the margins of this model")
    parser.add_argument("--shared", type=Path, default=Path("../shared"), help="data folder")
    options = parser.parse_args()
    if options.share < LEAST_SHARE:
        parser.error(f"--share {options.share:g}: expected at least {LEAST_SHARE}")
    tables = options.shared / "gtoc" / "official"

    def dataset(part: str, family: str, made: Protocol, legs: int, seed: int) -> str:
        folder = options.out / part / family
        generate(made, int(legs * options.share), folder, seed, options.workers)
        return str(folder)

    def train(folders: list[str], name: str) -> Path:
        model = options.out / f"{name}.seqmodel"
        recipe = ["--model", "margin", "--epochs", options.epochs, "--seed", "1"]
        if not model.exists() and feasibility(["train", *folders, *recipe, "--out", str(model)]):
            raise SystemExit(1)
        return model

    def margins() -> tuple[Path, list[str]]:
        learned, test = [], []
        for family, (legs, test_legs) in FAMILIES.items():
            made = protocol(family, tables)
            learned.append(dataset("train", family, made, legs, TRAINING_SEED))
            if test_legs:
                test.append(dataset("test", family, natural(made), test_legs, TEST_SEED))
        model = train(learned, "margin")
        for round_ in range(1, options.hard_rounds + 1):
            for family, legs in HARD.items():
                made = harder(protocol(family, tables), model, HARD_FACTOR)
                learned.append(dataset(f"hard{round_}", family, made, legs, HARD_SEED + round_))
            model = train(learned, f"margin-hard{round_}")
        return model, test

    model, test = (options.margin_model, []) if options.margin_model else margins()
    flown = [
        dataset("final-mass", family, final_mass_protocol(family, tables), legs, SEED)
        for family, legs in LEGS.items()
    ]
    test_flown = [
        dataset("test-final-mass", family, fresh_protocol(family, tables), TEST_LEGS, FRESH_SEED)
        for family in TESTS
    ]
    whole = str(options.out / "default.seqmodel")
    final_mass = ["train", *flown, "--model", "final-mass", "--start", str(model), "--seed", "1"]
    code = feasibility([*final_mass, "--out", whole])
    # In two tables: families of both kinds have the same names.
    for judged in (test, test_flown):
        code = code or (feasibility(["evaluate", whole, *judged]) if judged else 0)
    return code


if __name__ == "__main__":
    sys.exit(main())
