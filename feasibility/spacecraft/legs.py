"""Freshly solved legs of a spacecraft, to judge or train a model with; made anew or completed."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from feasibility.dataset import Dataset, begin, read_dataset
from feasibility.dataset.protocol import Protocol
from feasibility.runtime.workers import default_workers, worker_pool
from feasibility.sims_flanagan.fast.compilation import compile_kernels
from feasibility.spacecraft.spacecraft_file import SpacecraftFile

_LEAST_LEGS: Final = 2
"""Legs of the smallest part: a share may be tiny."""


@final
@dataclass(frozen=True)
class Part:
    """One dataset that is to be made.

    Attributes
    ----------
    name : str
        Name of its folder.
    protocol : Protocol
        How its legs are drawn and labelled.
    legs : int
        How many.
    seed : int
        Seed of the draws.
    """

    name: str
    protocol: Protocol
    legs: int
    seed: int


def parts_of(
    craft: SpacecraftFile, catalogues: Sequence[str], legs: int, seed: int, prefix: str
) -> list[Part]:
    """Return the datasets of a spacecraft's legs, evenly from all catalogues.

    Parameters
    ----------
    craft : SpacecraftFile
        The spacecraft and how its legs are drawn.
    catalogues : sequence of str
        Asteroid tables; none for a synthetic main belt.
    legs : int
        Legs in all, but for rounding.
    seed : int
        Seed of the draws.
    prefix : str
        Beginning of the folders' names.
    """
    parts = []
    files: Sequence[str | None] = catalogues or [None]
    for number, file in enumerate(files):
        place = f"-{number + 1}" if len(files) > 1 else ""
        for kind, (protocol, share) in craft.protocols(file).items():
            count = max(round(legs * share / len(files)), _LEAST_LEGS)
            parts.append(Part(f"{prefix}-{kind}{place}", protocol, count, seed))
    return parts


def make(parts: Sequence[Part], folder: Path, workers: int | None) -> list[Dataset]:
    """Make the datasets, or what is missing of them, and read them.

    Raises
    ------
    InputError
        A catalogue that cannot be used, a folder begun with other settings or not writable.
    """
    from tqdm import tqdm

    generations = [begin(p.protocol, p.legs, folder / p.name, seed=p.seed) for p in parts]
    missing = sum(generation.legs_missing for generation in generations)
    if missing:
        count = workers or default_workers()
        compile_kernels()
        total = sum(part.legs for part in parts)
        # disable=None: silent where stderr is no terminal.
        with (
            worker_pool(count) as pool,
            tqdm(total=total, initial=total - missing, unit=" legs", disable=None) as bar,
        ):
            for generation in generations:
                generation.run(pool, in_flight=2 * count, on_shard=bar.update)
    return [read_dataset(folder / part.name) for part in parts]
