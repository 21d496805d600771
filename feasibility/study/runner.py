"""Run experiments: data, order, record of what was run."""

import importlib
import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Final, final

import msgspec

from feasibility.dataset import Dataset, begin, read_dataset, read_protocol
from feasibility.errors import InputError
from feasibility.learning.paper.models.dnn import find_device
from feasibility.learning.paper.models.precision import resolve_precision
from feasibility.runtime.atomic import write_json
from feasibility.runtime.extras import load_extra
from feasibility.runtime.folders import make_folder
from feasibility.runtime.provenance import provenance
from feasibility.runtime.workers import default_workers, worker_pool
from feasibility.study import EXPERIMENTS
from feasibility.study.cells import Cells
from feasibility.study.context import Context
from feasibility.study.data import StudyData
from feasibility.study.presets import Preset
from feasibility.study.result import Result

_TRAINING: Final = ("torch", "scikit-learn", "imbalanced-learn", "optuna")

RECORD: Final = "study.json"
"""File of a study's folder that says what was run."""


@final
@dataclass(frozen=True)
class Settings:
    """What a study is run with.

    Attributes
    ----------
    preset : Preset
        Sizes, seeds and trials.
    out : Path
        Folder of the study.
    data : Path, optional
        A dataset of ``feasibility generate``; made under `out` if not given.
    catalogue : str, optional
        Asteroid table of the legs that are made; a synthetic belt if not given.
    seed : int
        Seed of the legs and of the split.
    workers : int
        Processes of what runs in parallel.
    threads : int, optional
        Threads of a network's training; by default one where it is in bfloat16, which a second
        one hardly speeds up and waiting for it slows down, else one a core.
    device : str
        Where networks are trained: "cpu", "cuda" or "auto".
    precision : str
        In what they are trained: "float32", "bfloat16", or "auto" for bfloat16 where the
        hardware has it.
    """

    preset: Preset
    out: Path
    data: Path | None = None
    catalogue: str | None = None
    seed: int = 0
    workers: int = 2
    threads: int | None = None
    device: str = "cpu"
    precision: str = "auto"


def run_study(
    settings: Settings, names: Sequence[str], say: Callable[[str], None] = print
) -> dict[str, Result]:
    """Run experiments and write tables, figures and ``study.json``.

    Cells that were computed before are reused, so that running it again goes
    on where an interrupted study stopped.

    Parameters
    ----------
    settings : Settings
        What to run with; a folder that was begun with others is refused.
    names : sequence of str
        Keys of `EXPERIMENTS`.
    say : callable
        Told about progress, a line at a time.

    Returns
    -------
    dict of str to Result
        By name, in the order given.

    Raises
    ------
    InputError
        An unknown experiment, a folder of another study, data that cannot be used.
    MissingDependencyError
        The extra ``train`` or pyarrow is not installed.
    """
    for name in names:
        if name not in EXPERIMENTS:
            raise InputError(f"study {name}: expected one of {', '.join(EXPERIMENTS)}")
    for package in ("torch", "sklearn", "imblearn", "optuna"):
        load_extra(package)
    began = time.perf_counter()
    dataset = _dataset(settings, say)
    data = StudyData.build(dataset, settings.preset, settings.seed)
    record = _open_record(settings, data)
    record["data"]["preparation_s"] = record["data"].get(
        "preparation_s", time.perf_counter() - began
    )
    say(
        f"{data.source}: {data.y.mean():.1%} flyable, {len(data.pool)} to learn from "
        f"(balanced at most {2 * data.smaller_class}), {len(data.test)} to test on"
    )
    context = Context(
        preset=settings.preset,
        data=data,
        cells=Cells(settings.out / "cells", say),
        out=settings.out,
        workers=settings.workers,
        threads=_threads(settings, record["recipe"]["precision"]),
        device=settings.device,
        precision=record["recipe"]["precision"],
        say=say,
    )
    results = {}
    for number, name in enumerate(names, start=1):
        say(f"[{number}/{len(names)}] {name}: {EXPERIMENTS[name]}")
        results[name] = _run_one(context, name, record)
        for finding in results[name].findings:
            say(f"  {finding}")
    return results


def read_record(out: Path) -> dict[str, Any]:
    """Return what ``study.json`` says.

    Raises
    ------
    InputError
        There is none, or it is damaged.
    """
    path = out / RECORD
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: expected the record of a study ({error})") from None
    if not isinstance(record, dict) or not {"recipe", "data", "experiments"} <= set(record):
        raise InputError(f"{path}: expected a record with recipe, data and experiments")
    return record


def _run_one(context: Context, name: str, record: dict[str, Any]) -> Result:
    before = set(context.cells.used_seconds)
    experiment = importlib.import_module(f"feasibility.study.{name}")
    result: Result = experiment.run(context)
    # Read again: another process may have done other experiments in the same folder meanwhile.
    record["experiments"] = read_record(context.out)["experiments"]
    # What a cell took counts whenever it was computed, and for the first experiment that used it.
    own = {p: s for p, s in context.cells.used_seconds.items() if p not in before}
    if own or name not in record["experiments"]:
        record["experiments"][name] = {"seconds": sum(own.values()), "cells": len(own)}
    _write_record(context.out, record)
    return result


def _dataset(settings: Settings, say: Callable[[str], None]) -> Dataset:
    if settings.data is not None:
        return read_dataset(settings.data)
    protocol = read_protocol("table1")
    if settings.catalogue is not None:
        protocol = protocol.with_catalogue(settings.catalogue)
    # The study needs m* alone; small shards keep all workers busy to the end.
    shard = max(50, min(protocol.legs_per_shard, settings.preset.legs // (8 * settings.workers)))
    protocol = msgspec.structs.replace(protocol, propellant=False, legs_per_shard=shard)
    folder = settings.out / "legs"
    make_folder(settings.out)
    generation = begin(protocol, settings.preset.legs, folder, seed=settings.seed)
    if generation.tasks:
        say(f"making {generation.legs_missing} legs in {folder}")
        began = time.perf_counter()
        done = 0

        def on_shard(rows: int) -> None:
            nonlocal done
            done += rows
            rate = done / (time.perf_counter() - began)
            say(f"  {done} of {generation.legs_missing} legs, {rate:.0f} legs/s")

        with worker_pool(settings.workers) as executor:
            generation.run(executor, in_flight=2 * settings.workers, on_shard=on_shard)
    return read_dataset(folder)


def _open_record(settings: Settings, data: StudyData) -> dict[str, Any]:
    """Return the record of the folder, begun now or before with the same settings."""
    torch = load_extra("torch")
    device = find_device(torch, settings.device)
    precision = resolve_precision(torch, settings.precision, device)
    recipe = {
        "preset": settings.preset.name,
        "sizes": json.loads(json.dumps(settings.preset.to_dict())),
        "seed": settings.seed,
        "fingerprint": data.fingerprint,
        "precision": precision,
    }
    make_folder(settings.out)
    if (settings.out / RECORD).exists():
        record = read_record(settings.out)
        for key, value in recipe.items():
            if record["recipe"].get(key) != value:
                raise InputError(
                    f"{settings.out}: holds a study with another {key}; expected the same preset, "
                    "seed, data and precision as before, or another --out"
                )
        return record
    record = {
        "recipe": recipe,
        "data": {
            "source": data.source,
            "legs": len(data.y),
            "flyable_share": float(data.y.mean()),
            "pool": len(data.pool),
            "largest_balanced": 2 * data.smaller_class,
            "test": len(data.test),
            "catalogue_given": settings.catalogue is not None,
            "data_given": settings.data is not None,
        },
        "workers": settings.workers,
        "threads": _threads(settings, precision),
        "device": settings.device,
        "provenance": provenance(),
        "training_versions": {name: metadata.version(name) for name in _TRAINING},
        "machine": machine(),
        "experiments": {},
    }
    _write_record(settings.out, record)
    return record


def _threads(settings: Settings, precision: str) -> int:
    if settings.threads is not None:
        return settings.threads
    return 1 if precision == "bfloat16" else default_workers()


def _write_record(out: Path, record: dict[str, Any]) -> None:
    write_json(out / RECORD, record)


def machine() -> dict[str, Any]:
    """Return the processor's name, its cores and the memory in GiB, as far as they can be had."""
    name, memory_gib = "", None
    cpuinfo, meminfo = Path("/proc/cpuinfo"), Path("/proc/meminfo")
    if cpuinfo.exists():
        lines = cpuinfo.read_text(encoding="utf-8").splitlines()
        name = next((line.partition(":")[2].strip() for line in lines if "model name" in line), "")
    if meminfo.exists():
        kib = meminfo.read_text(encoding="utf-8").split()[1]
        memory_gib = round(int(kib) / 2**20)
    return {"processor": name, "cores": os.cpu_count(), "memory_gib": memory_gib}
