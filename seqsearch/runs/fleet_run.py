"""`run_fleet`: one probe after another, each leaves its asteroids to none that follow."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import msgspec

from feasibility.runtime.folders import new_folder
from feasibility.runtime.terminal import Level, say
from seqsearch.budget import Limits
from seqsearch.problems.problem_file import Config
from seqsearch.runs.fleet import probe_folder, write_fleet
from seqsearch.runs.polishing import polish_run
from seqsearch.runs.run_folder import SEQUENCE
from seqsearch.tours.tour import Tour
from seqsearch.tours.tour_files import read_tour

SearchProbe = Callable[[Config, Path, int, Limits], int]
"""Searches with a configuration into a folder with a seed and a budget; returns the exit code."""


def run_fleet(
    config: Config,
    folder: Path,
    *,
    seed: int,
    limits: Limits,
    search_probe: SearchProbe,
) -> int:
    """Search and polish the probes of a fleet one after another and return the exit code.

    Each probe is a run of its own in a sub-folder, whose configuration excludes
    the asteroids of the probes before it; so each can be verified, resumed and
    polished like any run. A time limit is shared: what a probe does not use is
    for those after it.

    Parameters
    ----------
    config : Config
        With ``fleet.probes`` of 2 or more.
    folder : Path
        Is made; gets ``fleet.json`` and the sub-folders.
    seed : int
        Of the first probe; each next has the next.
    limits : Limits
        For the whole fleet; `max_solves` for each probe.
    search_probe : callable
        The search for one probe.

    Raises
    ------
    InputError
        The folder exists, or anything that a run of one probe may raise.
    """
    begin = time.monotonic()
    new_folder(folder)
    probes = config.fleet.probes
    tours: list[Tour] = []
    for number in range(1, probes + 1):
        sub = folder / probe_folder(number)
        single = _without(config, [body.id for tour in tours for body in tour.visits])
        share_s = None
        if limits.time_limit_s is not None:
            left_s = max(1.0, limits.time_limit_s - (time.monotonic() - begin))
            share_s = left_s / (probes - number + 1)
        probe_seed = seed + number - 1
        say(f"probe {number} of {probes}", Level.PROGRESS)
        polish_share = config.fleet.polish_share
        code = search_probe(
            single,
            sub,
            probe_seed,
            replace(
                limits,
                time_limit_s=None if share_s is None else (1.0 - polish_share) * share_s,
            ),
        )
        if code != 0:
            return code
        if polish_share > 0 and read_tour(sub / SEQUENCE).legs:
            code = polish_run(
                sub,
                time_limit_s=None if share_s is None else polish_share * share_s,
                seed=probe_seed,
                workers=limits.workers,
                scheduler=limits.scheduler,
            )
            if code != 0:
                return code
        tours.append(read_tour(sub / SEQUENCE))
        write_fleet(folder, tours, probes, seed)
    say()
    for number, tour in enumerate(tours, 1):
        say(f"probe {number}: {tour.summary()}")
    total = sum(tour.n_asteroids for tour in tours)
    say(f"{total} asteroids; check them with: seqsearch verify {folder}")
    return 0


def _without(config: Config, ids: list[int]) -> Config:
    """Return the configuration of a single probe that leaves these asteroids to the others."""
    catalogue = msgspec.structs.replace(
        config.catalogue, exclude_ids=(*config.catalogue.exclude_ids, *ids)
    )
    fleet = msgspec.structs.replace(config.fleet, probes=1)
    return msgspec.structs.replace(config, catalogue=catalogue, fleet=fleet)
