"""The report of a study: all sections, with what was run and on what."""

import shutil
from pathlib import Path
from typing import Any, Final

from feasibility.errors import InputError
from feasibility.runtime.atomic import atomic_path, write_text
from feasibility.runtime.folders import make_folder
from feasibility.study import EXPERIMENTS
from feasibility.study.result import Result
from feasibility.study.runner import read_record

REPORT: Final = "report.md"
"""File of the report in a study's folder."""

BY_HAND: Final = "<!-- written by hand from here; kept when this file is made again -->"
"""Line of a document below which `write_document` changes nothing."""

_VERSIONS: Final = ("numpy", "scipy", "numba", "pykep", "pygmo")


def write_report(out: Path) -> Path:
    """Gather the results of a study in ``out/report.md`` and return its path.

    Raises
    ------
    InputError
        There is no study in `out`.
    """
    path = out / REPORT
    write_text(path, _text(out, figure_folder=""))
    return path


def write_document(out: Path, document: Path) -> Path:
    """Write the report as a document elsewhere, its figures in a folder of the same name.

    What follows the line `BY_HAND` in an older version of the document is kept.

    Parameters
    ----------
    out : Path
        Folder of the study.
    document : Path
        A file that ends in ``.md``; the figures go beside it, in a folder without the ending.

    Raises
    ------
    InputError
        There is no study in `out`, or the document cannot be written.
    """
    if document.suffix != ".md":
        raise InputError(f"{document}: expected a name that ends in .md")
    text = _text(out, figure_folder=f"{document.stem}/")
    for name in EXPERIMENTS:
        result = Result.read(out, name)
        if result is None:
            continue
        folder = document.with_suffix("") / name
        make_folder(folder)
        for figure in result.figures:
            with atomic_path(folder / f"{figure}.png") as temporary:
                shutil.copyfile(out / name / f"{figure}.png", temporary)
    kept = ""
    if document.exists():
        kept = document.read_text(encoding="utf-8").partition(BY_HAND)[2]
    write_text(document, f"{text}\n{BY_HAND}{kept or chr(10)}")
    return document


def _text(out: Path, figure_folder: str) -> str:
    record = read_record(out)
    results = [result for name in EXPERIMENTS if (result := Result.read(out, name)) is not None]
    missing = [name for name in EXPERIMENTS if not (out / name / "result.json").exists()]
    parts = ["# The paper's experiments, repeated", _introduction(record)]
    if missing:
        parts.append(f"Not run yet: {', '.join(missing)}.")
    parts += ["## What was run", _what_was_run(record)]
    parts += [result.markdown(figure_folder).rstrip() for result in results]
    return "\n\n".join(parts) + "\n"


def _introduction(record: dict[str, Any]) -> str:
    text = (
        'Xie & Dempster, "Feasible low-thrust trajectory identification via a deep neural network '
        'classifier", repeated on legs that anyone can make again, with our label: a leg is '
        "flyable where its initial mass is at most m*, the largest with which the leg exists. "
        "The paper's figures stand beside ours. All numbers, tables and figures here are written "
        "by the command below."
    )
    preset = record["recipe"]["preset"]
    if preset == "quick":
        text += (
            f"\n\n**Preset quick: {record['data']['legs']} legs.** These figures show that every "
            "experiment runs and which way its effects go; for the paper's sizes take `laptop` or "
            "`paper`."
        )
    return text


def command(record: dict[str, Any]) -> str:
    """Return the command line that repeats a study."""
    words = ["feasibility study all", f"--preset {record['recipe']['preset']}"]
    if record["data"]["data_given"]:
        words.append("--data DIR")
    elif record["data"]["catalogue_given"]:
        words.append("--catalogue FILE")
    if record["recipe"]["seed"]:
        words.append(f"--seed {record['recipe']['seed']}")
    return " ".join([*words, "--out runs/study"])


def _what_was_run(record: dict[str, Any]) -> str:
    data, machine, origin = record["data"], record["machine"], record["provenance"]
    known = {**origin["versions"], **record["training_versions"]}
    versions = ", ".join(
        f"{name} {known[name]}" for name in (*_VERSIONS, *record["training_versions"])
    )
    experiments = record["experiments"]
    total = sum(entry["seconds"] for entry in experiments.values())
    rows = [
        ("command", f"`{command(record)}`"),
        ("legs", data["source"]),
        ("flyable", f"{data['flyable_share']:.1%}"),
        (
            "to learn from",
            f"{data['pool']}, balanced at most {data['largest_balanced']}, in five folds; no pair "
            "of bodies is in two folds or in fold and test",
        ),
        ("to test on", f"{data['test']}, balanced"),
        (
            "training of a network",
            f"{record['recipe']['sizes']['epochs']} epochs, more where these are fewer than "
            f"{record['recipe']['sizes']['least_steps']} steps (the drops of the rate are then "
            "spread in proportion)",
        ),
        (
            "machine",
            f"{machine['processor']}, {machine['cores']} cores, {machine['memory_gib']} GiB; "
            f"{record['workers']} workers, {record['threads']} threads, networks on "
            f"{record['device']} in {record['recipe']['precision']}",
        ),
        ("versions", f"Python {origin['python']}, {versions}"),
        ("commit", str(origin["git_commit"])),
        ("begun", origin["created_utc"]),
        (
            "time",
            f"{duration(data['preparation_s'])} for legs and features, {duration(total)} for the "
            "trainings and solves of the experiments, by the clock of one process each ("
            + ", ".join(f"{name} {duration(e['seconds'])}" for name, e in experiments.items())
            + ")",
        ),
    ]
    lines = ["| | |", "| --- | --- |", *(f"| {name} | {text} |" for name, text in rows)]
    return "\n".join(lines)


def duration(seconds: float) -> str:
    """Return a time as people say it: ``42 s``, ``7 min`` or ``3.4 h``."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
