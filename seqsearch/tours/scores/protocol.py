"""The `ScoreRule` protocol: what a problem counts."""

from typing import ClassVar, Protocol, runtime_checkable

from seqsearch.tours.records import TourBody, TourLeg


@runtime_checkable
class ScoreRule(Protocol):
    """How a tour is scored, from its record alone; larger is better.

    An implementation is a frozen `msgspec.Struct` whose tag (``tag_field="kind"``) names the
    kind in the tour file; its fields are the rule's numbers. The verification computes the
    score anew.

    Attributes
    ----------
    name, unit : str
        What the score is called in reports, and its unit; an empty name where it is the
        number of visited bodies.
    """

    name: ClassVar[str]
    unit: ClassVar[str]

    def score(self, visits: tuple[TourBody, ...], legs: tuple[TourLeg, ...], /) -> float:
        """Return the score.

        Parameters
        ----------
        visits : tuple of TourBody
            The visited bodies in order; a planet from which the tour was launched is not
            among them.
        legs : tuple of TourLeg
            The legs in order of flight; there may be none.
        """
        ...
