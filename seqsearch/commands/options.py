"""Options that several commands share, and what their texts mean."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility import InputError
from feasibility.runtime.terminal import Level, say_json, set_level

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]
    """What a command's parser is added to."""

_UNITS_S: Final = {"": 1.0, "s": 1.0, "sec": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0}


def add_limits(command: argparse.ArgumentParser) -> None:
    """Add the options about when to stop, and who works."""
    command.add_argument(
        "--time-limit",
        metavar="T",
        help="stop after 90s, 10min, 1h in all; passes go on until then",
    )
    command.add_argument(
        "--max-solves",
        type=int,
        metavar="N",
        help="stop after N full optimisations in all; passes go on until then",
    )
    add_workers(command)


def add_output(command: argparse.ArgumentParser) -> None:
    """Add how much is printed, and for whom."""
    much = command.add_mutually_exclusive_group()
    much.add_argument("-q", "--quiet", action="store_true", help="print results alone")
    much.add_argument("-v", "--verbose", action="store_true", help="print all counts of each rank")
    much.add_argument("--json", action="store_true", help="print the result as JSON, nothing else")


def set_output(options: argparse.Namespace) -> None:
    """Follow the options of `add_output`, where a command has them."""
    if getattr(options, "json", False):
        set_level(Level.SILENT)
    elif getattr(options, "quiet", False):
        set_level(Level.RESULTS)
    else:
        set_level(Level.DETAILS if getattr(options, "verbose", False) else Level.PROGRESS)


def add_catalogue(command: argparse.ArgumentParser) -> None:
    """Add where the asteroid table of a run is now."""
    command.add_argument(
        "--catalogue",
        metavar="FILE",
        help="the run's asteroid table, if it is not where it was",
    )


def add_workers(command: argparse.ArgumentParser) -> None:
    """Add who works: the number of processes, or a cluster."""
    command.add_argument(
        "--workers",
        type=int,
        help="processes (default: one a core); with --scheduler, threads of this process alone",
    )
    command.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="use a running Dask cluster, such as tcp://host:8786, instead of own processes",
    )


def seconds(duration: str | None, option: str = "--time-limit") -> float | None:
    """Return the seconds of an optional duration."""
    return None if duration is None else parse_duration(duration, option)


def parse_duration(text: str, option: str = "--time-limit") -> float:
    """Return a duration such as ``90s``, ``10min``, ``1.5h`` or ``600`` in seconds.

    Raises
    ------
    InputError
        Not a positive number with one of these units.
    """
    match = re.fullmatch(r"\s*([0-9]*\.?[0-9]+)\s*([a-z]*)\s*", text)
    if match is None or match[2] not in _UNITS_S or float(match[1]) <= 0:
        raise InputError(f"{option} {text!r}: expected a duration such as 90s, 10min or 1h")
    return float(match[1]) * _UNITS_S[match[2]]


def print_result(options: argparse.Namespace, folder: Path, code: int) -> int:
    """Print the tours of a run folder as JSON, if that was asked for, and return the exit code."""
    if getattr(options, "json", False) and code in (0, 130, 143):
        # Imported here: it loads what writes runs.
        from seqsearch.runs.summary import summary

        say_json(summary(folder))
    return code


def sequence_path(run: str) -> Path:
    """Return the tour file that a run folder, or the path of one, stands for."""
    # Imported here: it loads what writes runs.
    from seqsearch.runs.run_folder import SEQUENCE

    path = Path(run)
    return path / SEQUENCE if path.is_dir() else path
