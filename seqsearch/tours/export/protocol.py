"""The `Exporter` protocol: writes a flight as a file of one format."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, final, runtime_checkable

from seqsearch.tours.tour import Tour
from seqsearch.tours.trajectory import Trajectory


@final
@dataclass(frozen=True)
class Flight:
    """What is exported.

    Attributes
    ----------
    tour : Tour
        Bodies, legs and rules.
    trajectory : Trajectory
        The rows of its legs: of continuous thrust where the tour was refined, else with its
        impulses as jumps of velocity. One phase for each leg of the tour.
    """

    tour: Tour
    trajectory: Trajectory


@runtime_checkable
class Exporter(Protocol):
    """Writes flights in one format; made without arguments.

    Attributes
    ----------
    name : str
        What the command line calls the format, in small letters.
    """

    @property
    def name(self) -> str: ...  # noqa: D102

    def write(self, flight: Flight, path: Path, /) -> None:
        """Write a file, whole or not at all.

        Raises
        ------
        InputError
            The format cannot say this flight, for instance impulses where it wants thrust, or
            the file cannot be written.
        MissingDependencyError
            A package that the format needs is not installed.
        """
        ...
