"""The run folder: configuration, provenance, counters and the best tour so far."""

import csv
import hashlib
import io
import json
import os
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Final, Self, final

from feasibility import InputError
from feasibility.runtime.atomic import write_json, write_text
from feasibility.runtime.folders import new_folder
from feasibility.runtime.provenance import provenance
from seqsearch.beam.counters import RankCounters
from seqsearch.problems.problem_file import Config, to_toml, with_catalogue
from seqsearch.pruning.audit_estimate import AuditEstimate
from seqsearch.tours.tour import Tour
from seqsearch.tours.tour_files import read_tour, to_csv, to_json

CONFIG: Final = "config.toml"
"""Name of the file with everything that was set."""

SEQUENCE: Final = "sequence.json"
"""Name of the file with the best tour."""


CSV: Final = "sequence.csv"
"""Name of the file with its legs."""

SEARCHED: Final = "sequence.search.json"
"""Name of the file that keeps the best tour as the search found it."""

POLISHED: Final = "sequence.polished.json"
"""Name of the file that keeps the best tour that polishing found."""

_SIDES: Final = ("pruned", "kept")

PROVENANCE: Final = "provenance.json"
"""Name of the file that says where the run came from."""


CANDIDATES: Final = "candidates.csv"
"""Name of the file with the audited candidates one by one: a random sample of each rank."""

COUNTERS: Final = "counters.csv"
"""Name of the file with what happened at each rank."""

AUDIT: Final = "audit.json"
"""Name of the file that says what pruning cost."""


@final
class RunFolder:
    """Writes what a run produces; each file is complete or absent at any moment.

    Use `create` or `open`. The files are ``config.toml`` (resolved),
    ``provenance.json`` (seed, versions, git commit, command), ``counters.csv``,
    ``audit.json``, ``candidates.csv``, ``sequence.json`` and ``sequence.csv``; the last five are
    rewritten after each rank, so an interrupted run leaves its best tour. The stages of
    a tour are kept beside it, as ``sequence.search.json`` and ``sequence.polished.json``.
    """

    def __init__(
        self, path: Path, found: Tour | None = None, polished: Tour | None = None
    ) -> None:
        self.path = path
        self._found = found
        self._polished = polished

    @classmethod
    def create(cls, path: Path, config: Config, seed: int) -> Self:
        """Make a new folder and write configuration and provenance.

        Raises
        ------
        InputError
            The folder exists or cannot be created; nothing is overwritten.
        """
        new_folder(path)
        folder = cls(path)
        write_text(path / CONFIG, to_toml(portable(config, path)))
        write_json(path / PROVENANCE, provenance() | {"seed": seed})
        return folder

    @classmethod
    def open(cls, path: Path) -> Self:
        """Return the folder of a run that was begun before.

        Raises
        ------
        InputError
            A tour in it cannot be read.
        """
        found, polished, best = (
            read_tour(path / name) if (path / name).exists() else None
            for name in (SEARCHED, POLISHED, SEQUENCE)
        )
        return cls(path, found or best, polished)

    def config_digest(self) -> str:
        """Return the SHA-256 of the configuration file.

        Raises
        ------
        InputError
            It cannot be read.
        """
        file = self.path / CONFIG
        try:
            return hashlib.sha256(file.read_bytes()).hexdigest()
        except OSError as error:
            raise InputError(f"{file}: cannot be read ({error.strerror})") from None

    def note_session(self, time_limit_s: float | None, max_solves: int | None) -> None:
        """Add to the provenance that the run goes on.

        Raises
        ------
        InputError
            The file cannot be read or written.
        """
        file = self.path / PROVENANCE
        try:
            record = json.loads(file.read_text(encoding="utf-8"))
            sessions = record.setdefault("resumed", [])
        except (OSError, ValueError, AttributeError) as error:
            raise InputError(f"{file}: cannot be read ({error})") from None
        sessions.append(provenance() | {"time_limit_s": time_limit_s, "max_solves": max_solves})
        write_json(file, record)

    def write(self, tour: Tour, counters: Sequence[RankCounters]) -> None:
        """Write the best tour that the search has found, the counters and the audit.

        A tour with a lower score than the one that was found before does not replace it:
        a resumed run repeats the rank that was cut short. Neither does it replace a polished
        one that is as good.

        Raises
        ------
        InputError
            A file cannot be written; the files written before are intact.
        """
        if self._found is None or _reached(tour) >= _reached(self._found):
            self._found = tour
            write_text(self.path / SEARCHED, to_json(tour))
            if self._polished is None or worth(tour) > worth(self._polished):
                self._write_best(tour)
        write_text(self.path / AUDIT, audit_json(counters))
        write_text(self.path / CANDIDATES, candidates_csv(counters))
        write_text(self.path / COUNTERS, counters_csv(counters))

    def write_polished(self, tour: Tour) -> None:
        """Write a tour that polishing made better than all before.

        Raises
        ------
        InputError
            As `write`.
        """
        self._polished = tour
        write_text(self.path / POLISHED, to_json(tour))
        self._write_best(tour)

    def _write_best(self, tour: Tour) -> None:
        write_text(self.path / SEQUENCE, to_json(tour))
        write_text(self.path / CSV, to_csv(tour))


def portable(config: Config, folder: Path) -> Config:
    """Return the configuration with the table's path as seen from the run folder."""
    file = config.catalogue.file
    return config if file is None else with_catalogue(config, os.path.relpath(file, folder))


def worth(tour: Tour) -> tuple[float, int, float, float]:
    """Return what tells the better of two tours: score, visits, less time, more mass."""
    return (*_reached(tour), -tour.duration_days, tour.m_final_kg)


def _reached(tour: Tour) -> tuple[float, int]:
    return tour.score, tour.n_asteroids


def counters_csv(counters: Sequence[RankCounters]) -> str:
    """Return the counters as CSV, one row a rank, one column for each pruner."""
    pruners = list(dict.fromkeys(name for record in counters for name in record.pruned))
    rows = []
    for record in counters:
        row = {field.name: getattr(record, field.name) for field in fields(record)}
        pruned = row.pop("pruned")
        audit = row.pop("audit")
        row |= {f"pruned_{name}": pruned.get(name, 0) for name in pruners}
        for side in _SIDES:
            strata = () if audit is None else getattr(audit, side)
            row[f"audited_{side}"] = sum(stratum.solved for stratum in strata)
            row[f"audited_{side}_flyable"] = sum(stratum.flyable for stratum in strata)
        row |= {key: round(value, 3) for key, value in row.items() if isinstance(value, float)}
        rows.append(row)
    text = io.StringIO()
    if rows:
        writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return text.getvalue()


def audit_json(counters: Sequence[RankCounters]) -> str:
    """Return what the audits say together, and the strata of each."""
    audited = [(record, record.audit) for record in counters if record.audit is not None]
    estimate = asdict(AuditEstimate.of(audit for _, audit in audited))
    ranks = [
        {"pass": record.pass_number, "rank": record.rank}
        | {side: [asdict(stratum) for stratum in getattr(audit, side)] for side in _SIDES}
        for record, audit in audited
    ]
    # JSON knows no NaN: the rate where no flyable candidate was seen.
    plain = {key: None if value != value else value for key, value in estimate.items()}
    return json.dumps({"estimate": plain, "ranks": ranks}, indent=1, allow_nan=False) + "\n"


def candidates_csv(counters: Sequence[RankCounters]) -> str:
    """Return the audited candidates, one a row: what was decided, predicted and found."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["pass", "rank", "kept", "tof_days", "predicted_margin", "flyable"])
    for record in counters:
        for hop in () if record.audit is None else record.audit.hops:
            margin = "" if hop.margin is None else hop.margin
            row = [record.pass_number, record.rank, int(hop.kept), hop.tof_days, margin]
            writer.writerow([*row, int(hop.flyable)])
    return text.getvalue()
