"""`BodyTable`: what a reader found in a file, and the sieve that all readers share."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, MJD2000_MJD
from feasibility.errors import InputError
from feasibility.orbits.catalogue import Catalogue
from feasibility.orbits.readers.columns import NEEDED
from feasibility.runtime.text_column import taken_texts

UNNUMBERED: Final = 50_000_000
"""Added to the row's number where only some bodies have a number of their own."""

WORDS: Final = {
    "epoch": "epoch",
    "a": "semi-major axis",
    "e": "eccentricity",
    "i": "inclination",
    "node": "node",
    "argp": "argument of perihelion",
    "M": "mean anomaly",
}
UNBOUND: Final = "with e >= 1"
TOO_WIDE: Final = "with a semi-major axis outside 0.001 to 10 000 AU"

A_RANGE_AU: Final = (1e-3, 1e4)
MAX_MJD: Final = 200_000.0
_NAMED: Final = 5
"""Bodies of which a report gives the names, for each reason."""


@final
@dataclass(frozen=True)
class LeftOut:
    """Bodies of a file that are no use for a search.

    Attributes
    ----------
    reason : str
        Such as "with e >= 1" or "without mean anomaly".
    count : int
        How many they are.
    names : tuple of str
        The first of them.
    """

    reason: str
    count: int
    names: tuple[str, ...]

    def __str__(self) -> str:
        names = ", ".join(self.names) + (", ..." if self.count > len(self.names) else "")
        return f"{self.count} {self.reason} ({names})"


@final
class LeftOutCounts:
    """Counts what is left out, row by row."""

    def __init__(self) -> None:
        self._names: dict[str, list[str]] = {}

    def add(self, reason: str, name: str) -> None:
        """Count one body."""
        self._names.setdefault(reason, []).append(name)

    def counts(self) -> tuple[LeftOut, ...]:
        """Return what was counted, a line a reason."""
        return tuple(
            LeftOut(reason, len(names), tuple(names[:_NAMED]))
            for reason, names in self._names.items()
        )


@final
@dataclass(frozen=True, eq=False)
class BodyTable:
    """The bodies of one file in the units in which tables give them.

    With n the number of bodies.

    Attributes
    ----------
    label : str
        Name of the format.
    ids : (n,) int64
        All different.
    names : sequence of str
        n names.
    orbits : (n, 7) float64
        Epoch [MJD], a [AU], e, i, node, argp, mean anomaly [deg].
    extra : mapping of str to (n,) float64
        What else the file tells, in its units; NaN where it does not.
    left_out : tuple of LeftOut
        What was not taken over, and why.
    notes : tuple of str
        What users should know, as the end of a line that begins with the file's name.
    """

    label: str
    ids: NDArray[np.int64]
    names: Sequence[str]
    orbits: NDArray[np.float64]
    extra: Mapping[str, NDArray[np.float64]]
    left_out: tuple[LeftOut, ...] = ()
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def total(self) -> int:
        """How many bodies the file has, those left out included."""
        return len(self) + sum(part.count for part in self.left_out)

    def columns(self) -> dict[str, NDArray[np.float64] | NDArray[np.int64]]:
        """Return the (n,) columns by the names that a selection may use."""
        a, e = self.orbits[:, 1], self.orbits[:, 2]
        return {
            "id": self.ids,
            **{name: self.orbits[:, k] for k, name in enumerate(NEEDED)},
            "q": a * (1.0 - e),
            "Q": a * (1.0 + e),
            **self.extra,
        }

    def take(self, rows: NDArray[np.int64]) -> "BodyTable":
        """Return the table of some rows alone."""
        return BodyTable(
            self.label,
            self.ids[rows],
            taken_texts(self.names, rows),
            self.orbits[rows],
            {name: column[rows] for name, column in self.extra.items()},
            self.left_out,
            self.notes,
        )

    def left_out_line(self) -> str:
        """Return how many bodies were left out and why; empty for none."""
        if not self.left_out:
            return ""
        count = sum(part.count for part in self.left_out)
        return f"{count} of {self.total} left out: {', '.join(map(str, self.left_out))}"

    def catalogue(self, source: str) -> Catalogue:
        """Return the bodies in SI units."""
        orbits = self.orbits
        elements = np.column_stack([orbits[:, 1] * AU, orbits[:, 2], np.radians(orbits[:, 3:])])
        return Catalogue(
            self.ids, self.names, orbits[:, 0] - MJD2000_MJD, elements, source, self.extra
        )


def sieved(
    file: Path,
    label: str,
    ids: NDArray[np.int64],
    names: Sequence[str],
    orbits: NDArray[np.float64],
    extra: Mapping[str, NDArray[np.float64]],
    place: Callable[[int], str],
    notes: tuple[str, ...] = (),
) -> BodyTable:
    """Return the bodies on ellipses, all that is known of their orbits, and count the others.

    Parameters
    ----------
    file : Path
        For messages.
    label, ids, names, orbits, extra, notes
        As for `BodyTable`; in orbits NaN is what the file does not tell.
    place : callable
        Where the file has a row, such as "line 7".

    Raises
    ------
    InputError
        A number is out of range, an id occurs twice, or no body is left.
    """
    _check_ranges(file, orbits, place)
    reasons = _reasons(orbits)
    kept = np.flatnonzero(reasons == 0)
    texts = ["", UNBOUND, *(f"without {WORDS[name]}" for name in NEEDED), TOO_WIDE]
    left_out = []
    for code, reason in enumerate(texts):
        out = np.flatnonzero(reasons == code) if code else np.zeros(0, np.int64)
        if len(out):
            first = tuple(names[row] for row in out[:_NAMED].tolist())
            left_out.append(LeftOut(reason, len(out), first))
    whole = BodyTable(label, ids, names, orbits, extra, tuple(left_out), notes)
    if not len(kept):
        raise InputError(
            f"{file}: no body of {label} can be used"
            + (f", {whole.take(kept).left_out_line()}" if left_out else "")
        )
    _check_distinct(file, ids[kept], lambda row: place(int(kept[row])))
    return whole.take(kept) if left_out else whole


def _reasons(orbits: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return (n,) why a body is left out: 0 not, 1 unbound, 2.. the missing column, 9 too wide."""
    missing = np.isnan(orbits)
    reasons = np.where(missing.any(axis=1), 2 + np.argmax(missing, axis=1), 0)
    with np.errstate(invalid="ignore"):
        low, high = A_RANGE_AU
        wide = (orbits[:, 1] < low) | (orbits[:, 1] > high)
        reasons[wide & (reasons == 0)] = 2 + len(NEEDED)
        reasons[orbits[:, 2] >= 1.0] = 1
    return reasons.astype(np.int64)


_RANGES: Final = {
    "epoch": (0.0, MAX_MJD, f"an epoch in MJD, 0 to {MAX_MJD:g}"),
    "e": (0.0, np.inf, "an eccentricity, 0 or more"),
    "i": (0.0, 180.0, "an inclination of 0 to 180 degrees"),
    "node": (-720.0, 720.0, "an angle in degrees"),
    "argp": (-720.0, 720.0, "an angle in degrees"),
    "M": (-720.0, 720.0, "an angle in degrees"),
}


def _check_ranges(file: Path, orbits: NDArray[np.float64], place: Callable[[int], str]) -> None:
    with np.errstate(invalid="ignore"):
        bound = ~(orbits[:, 2] >= 1.0)
        for name, (low, high, expectation) in _RANGES.items():
            column = orbits[:, NEEDED.index(name)]
            # The mean anomaly of an unbound orbit is another angle; such a body is left out.
            outside = ((column < low) | (column > high) | np.isinf(column)) & bound
            if outside.any():
                row = int(np.argmax(outside))
                raise InputError(
                    f"{file}, {place(row)}: {name} is {column[row]:.10g}; expected {expectation}"
                )
        negative = (orbits[:, 1] <= 0.0) & bound
        if negative.any():
            row = int(np.argmax(negative))
            raise InputError(
                f"{file}, {place(row)}: a is {orbits[row, 1]:.10g} with e < 1; expected a "
                "semi-major axis in AU, more than 0"
            )


def _check_distinct(file: Path, ids: NDArray[np.int64], place: Callable[[int], str]) -> None:
    order = np.argsort(ids, kind="stable")
    same = np.flatnonzero(np.diff(ids[order]) == 0)
    if len(same):
        # The pair that the file shows first.
        later = order[same + 1]
        pair = int(np.argmin(later))
        first, second = int(order[same[pair]]), int(later[pair])
        raise InputError(
            f"{file}, {place(second)}: id {ids[second]} was given to {place(first)} already; "
            "expected different ids"
        )
