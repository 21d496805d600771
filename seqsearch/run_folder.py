"""The run folder: configuration, provenance, counters and the best tour so far."""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Final, Self, final

from feasibility import InputError
from feasibility.atomic import write_text
from feasibility.provenance import provenance
from seqsearch.config import Config, to_toml
from seqsearch.counters import RankCounters
from seqsearch.tour import Tour, to_csv, to_json

SEQUENCE: Final = "sequence.json"
"""Name of the file with the best tour."""


@final
class RunFolder:
    """Writes what a run produces; each file is complete or absent at any moment.

    Use `create`. The files are ``config.toml`` (resolved), ``provenance.json``
    (seed, versions, git commit, command), ``counters.csv``, ``sequence.json``
    and ``sequence.csv``; the last three are rewritten after each rank, so an
    interrupted run leaves its best tour.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def create(cls, path: Path, config: Config, seed: int) -> Self:
        """Make a new folder and write configuration and provenance.

        Raises
        ------
        InputError
            The folder exists or cannot be created; nothing is overwritten.
        """
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            raise InputError(
                f"{path}: exists; nothing is overwritten, choose another --out or remove it"
            ) from None
        except OSError as error:
            raise InputError(f"{path}: cannot be created ({error.strerror})") from None
        folder = cls(path)
        write_text(path / "config.toml", to_toml(config))
        record = provenance() | {"seed": seed}
        write_text(path / "provenance.json", json.dumps(record, indent=1) + "\n")
        return folder

    def write(self, tour: Tour, counters: Sequence[RankCounters]) -> None:
        """Write the best tour and the counters.

        Raises
        ------
        InputError
            A file cannot be written; the files written before are intact.
        """
        write_text(self.path / SEQUENCE, to_json(tour))
        write_text(self.path / "sequence.csv", to_csv(tour))
        write_text(self.path / "counters.csv", counters_csv(counters))


def counters_csv(counters: Sequence[RankCounters]) -> str:
    """Return the counters as CSV, one row a rank, one column for each pruner."""
    pruners = list(dict.fromkeys(name for record in counters for name in record.pruned))
    rows = []
    for record in counters:
        row = asdict(record)
        pruned = row.pop("pruned")
        audit = row.pop("audit")
        row |= {f"pruned_{name}": pruned.get(name, 0) for name in pruners}
        for side in ("pruned", "kept"):
            strata = [] if audit is None else audit[side]
            row[f"audited_{side}"] = sum(stratum["solved"] for stratum in strata)
            row[f"audited_{side}_flyable"] = sum(stratum["flyable"] for stratum in strata)
        row |= {key: round(value, 3) for key, value in row.items() if isinstance(value, float)}
        rows.append(row)
    text = io.StringIO()
    if rows:
        writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return text.getvalue()
