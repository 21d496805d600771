"""Make the large nets of the default model better: an ensemble learns, the nets learn from it.

Run from the root of the checkout, with the folder `shared` beside it:

    python training/distil.py pack rendezvous --out data/default --file data/rendezvous.npz
    python training/distil.py pack free-ends --out data/default --file data/free-ends.npz
    python training/distil.py train rendezvous --file data/rendezvous.npz --model better.seqmodel

The first two make the legs of `LEGS`, `MORE` and `HARD` as `default_model.py` makes them and write
what is needed to one file; they go on where they were interrupted. The third can run elsewhere:
with a GPU it takes minutes, without one days. It replaces the large net for one sort of legs and
its calibration; the quick ones, the thresholds, the domain and the nets for the final mass stay.
"""

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from default_model import FAMILIES, HARD_FACTOR, HARD_SEED, TRAINING_SEED, generate, protocol

from feasibility import FeasibilityClassifier
from feasibility.classifier.margin.views import FREE_ENDS, RENDEZVOUS, LegView
from feasibility.dataset import read_dataset
from feasibility.dataset.labels import file_sha256, load_catalogue
from feasibility.dataset.protocol import Protocol
from feasibility.learning.margin.distil import Distillation, UnsolvedLegs, distil
from feasibility.learning.margin.examples import RELEVANT, MarginExamples
from feasibility.learning.margin.hard_examples import harder
from feasibility.learning.margin.packed import pack, unpack
from feasibility.learning.margin.stack import StackRecipe
from feasibility.runtime.provenance import provenance
from feasibility.runtime.workers import in_threads, worker_pool

SECOND_SEED, SECOND_HARD_SEED, UNSOLVED_SEED = 12, 103, 900

VIEWS: Final = {"rendezvous": RENDEZVOUS, "free-ends": FREE_ENDS}

_FREE: Final = ("launch", "arrival", "launch-flyby", "flyby", "flyby-nea", "free")

LEGS: Final = {
    "rendezvous": {name: legs for name, (legs, _) in FAMILIES.items() if name not in _FREE},
    "free-ends": {name: FAMILIES[name][0] for name in _FREE},
}
"""Sort: family: legs of the default model."""

MORE: Final = {"rendezvous": {"nearby": 120_000}, "free-ends": {}}
"""The same with another seed."""

HARD: Final = {
    "rendezvous": {
        "nearby": ((20_000, HARD_SEED), (20_000, SECOND_HARD_SEED)),
        "nea": ((30_000, SECOND_HARD_SEED),),
        "general": ((15_000, SECOND_HARD_SEED),),
    },
    "free-ends": {
        "flyby": ((40_000, HARD_SEED), (40_000, SECOND_HARD_SEED)),
        "launch-flyby": ((30_000, HARD_SEED), (40_000, SECOND_HARD_SEED)),
        "launch": ((20_000, SECOND_HARD_SEED),),
        "arrival": ((15_000, SECOND_HARD_SEED),),
    },
}
"""Legs of which the model before is most unsure, and their seeds."""

UNSOLVED: Final = 3_000_000
"""Legs about which the teachers are asked, in the proportions of the solved ones."""

_DRAWN_AT_ONCE: Final = 5000

Part = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def folders(sort: str, options: argparse.Namespace) -> Iterator[Path]:
    """Make all datasets of a sort and yield their folders."""
    out, workers, tables = options.out, options.workers, options.shared / "gtoc" / "official"
    for family, legs in LEGS[sort].items():
        yield _made(protocol(family, tables), legs, out / "train" / family, TRAINING_SEED, workers)
    for family, legs in MORE[sort].items():
        yield _made(protocol(family, tables), legs, out / "more" / family, SECOND_SEED, workers)
    for family, rounds in HARD[sort].items():
        for legs, seed in rounds:
            made = harder(protocol(family, tables), Path(options.start), HARD_FACTOR)
            yield _made(made, legs, out / f"hard-{seed}" / family, seed, workers)


def _made(made: Protocol, legs: int, folder: Path, seed: int, workers: int) -> Path:
    generate(made, legs, folder, seed, workers)
    return folder


def examples_of(file: Path, view: LegView, threads: int) -> tuple[MarginExamples, np.ndarray]:
    """Return the examples of a packed file, and which dataset each is from."""
    packed = unpack(file)
    jobs = [
        rows
        for number in range(packed.dataset.max() + 1)
        for rows in np.array_split(np.flatnonzero(packed.dataset == number), threads)
        if len(rows)
    ]

    def part(rows: np.ndarray) -> MarginExamples:
        legs, m_star = packed.legs.take(rows), packed.m_star[rows]
        return MarginExamples.of_legs(legs, m_star, packed.pairs[rows], view, quick=False)

    part(jobs[0][:50])
    parts = list(in_threads(part, jobs, threads))
    source = [packed.dataset[rows[0]] for rows in jobs]
    return MarginExamples.concatenate(parts), np.repeat(source, [len(one.hint) for one in parts])


def draw(job: tuple[str, str, int, Path]) -> Part:
    """Return features, hints and the range that matters of some unsolved legs of a family."""
    sort, family, number, tables = job
    view, made = VIEWS[sort], protocol(family, tables)
    rng = np.random.default_rng([UNSOLVED_SEED, list(FAMILIES).index(family), number])
    catalogue = load_catalogue(made.catalogue, file_sha256(made.catalogue))
    drawn = made.sampler.draw(_DRAWN_AT_ONCE, rng, catalogue, made.craft(), made.impulsive_grid)
    rows = view.rows_of(drawn.legs)
    legs = drawn.legs.take(rows)
    X, hint = view.features(legs)
    known = np.isfinite(hint)
    # The heavier, the less acceleration: the range of masses the other way round.
    least = view.log_acceleration(legs, drawn.m0_max[rows]) - RELEVANT
    most = view.log_acceleration(legs, drawn.m0_min[rows]) + RELEVANT
    return X[known].astype(np.float32), hint[known], least[known], most[known]


def unsolved_legs(sort: str, count: int, tables: Path, workers: int) -> UnsolvedLegs:
    """Draw legs in the proportions of the families."""
    solved = {
        family: legs
        + MORE[sort].get(family, 0)
        + sum(number for number, _ in HARD[sort].get(family, ()))
        for family, legs in LEGS[sort].items()
    }
    total = sum(solved.values())
    jobs = [
        (sort, family, number, tables)
        for family, legs in solved.items()
        for number in range(max(1, round(count * legs / total / _DRAWN_AT_ONCE)))
    ]
    draw(jobs[0])
    with worker_pool(workers) as pool:
        parts = list(map(draw, jobs) if pool is None else pool.map(draw, jobs))
    return UnsolvedLegs(*(np.concatenate([part[k] for part in parts]) for k in range(4)))


def train(options: argparse.Namespace) -> None:
    """Train, save, and print the errors on what was left out."""
    began, view = time.monotonic(), VIEWS[options.sort]

    def say(*what: object) -> None:
        print(f"{time.monotonic() - began:6.0f} s", *what, flush=True)

    examples, source = examples_of(options.file, view, options.workers)
    say(f"{len(source)} solved legs")
    tables = options.tables or options.shared / "gtoc" / "official"
    unsolved = unsolved_legs(options.sort, options.unsolved, tables, options.workers)
    say(f"{len(unsolved.hint)} unsolved legs")
    start = FeasibilityClassifier.load(options.start).artefact
    shape = {"device": options.device, "threads": options.workers, "seed": 1}
    how = Distillation(
        teachers=StackRecipe(
            count=options.teachers,
            epochs=options.teacher_epochs,
            width=options.width,
            batch=options.batch,
            **shape,
        ),
        student=StackRecipe(
            epochs=options.student_epochs, batch=2 * options.batch, width=256, **shape
        ),
    )

    def on_epoch(who: str, epoch: int, loss: float) -> None:
        if epoch % 5 == 0:
            say(who, epoch, round(loss, 6))

    found = distil(examples, unsolved, view, start, how, on_epoch=on_epoch)
    before = found.model.provenance
    numbers = {"legs": len(source), "unsolved": len(unsolved.hint)}
    done = {**before.get("distilled", {}), options.sort: {**provenance(), **numbers}}
    replace(found.model, provenance={**before, "distilled": done}).save(options.model)
    relevant = examples.weight[found.held_out] == 1.0
    for number in [-1, *np.unique(source)]:
        rows = relevant if number < 0 else relevant & (source[found.held_out] == number)
        # Share that is decided rightly where masses are put anywhere within 15 % of m*.
        right = {
            who: 1.0 - np.mean(np.minimum(np.abs(error[rows]), 0.14)) / 0.28
            for who, error in found.errors.items()
        }
        median = {who: np.median(np.abs(error[rows])) for who, error in found.errors.items()}
        say(
            "all" if number < 0 else f"dataset {number}", int(rows.sum()),
            *(f"{who} {right[who]:.5f} ({median[who]:.6f})" for who in right),
        )  # fmt: skip


def main() -> int:
    """Read the command line and do it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("verb", choices=("pack", "train"))
    parser.add_argument("sort", choices=tuple(VIEWS))
    parser.add_argument("--out", type=Path, default=Path("data/default"), help="folder of legs")
    parser.add_argument("--file", type=Path, required=True, help="file of packed legs")
    parser.add_argument("--model", type=Path, help="file of the new model")
    parser.add_argument("--start", default="default", help="model to go on from")
    parser.add_argument("--teachers", type=int, default=8, help="nets that learn (default 8)")
    parser.add_argument("--width", type=int, default=512, help="of theirs (default 512)")
    parser.add_argument("--teacher-epochs", type=int, default=80, help="(default 80)")
    parser.add_argument("--student-epochs", type=int, default=100, help="(default 100)")
    parser.add_argument(
        "--batch", type=int, default=1024, help="legs a step, the student's twice (default 1024)"
    )
    parser.add_argument("--unsolved", type=int, default=UNSOLVED, help="legs to ask about")
    parser.add_argument("--device", default="auto", help="cpu, cuda, auto (default)")
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--shared", type=Path, default=Path("../shared"), help="data folder")
    parser.add_argument("--tables", type=Path, help="folder of the official tables")
    options = parser.parse_args()
    if options.verb == "pack":
        datasets = [read_dataset(folder) for folder in folders(options.sort, options)]
        print(pack(datasets, VIEWS[options.sort], options.file), "legs")
    else:
        train(options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
