"""`Groups`: the bodies are sorted into groups, and a tour visits one of each."""

from typing import final

import msgspec

from seqsearch.tours.checks import Check, FlownTour


@final
class Groups(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="groups",
):
    """The rule that a tour has at most one body of each group, and none of no group.

    A tour that visits one of each is complete; a search that was cut short may end before.

    Parameters
    ----------
    ids : tuple of tuple of int
        Ids of the bodies of each group.
    start_counts : bool
        Whether the start body is of a group; not where tours start at a planet.
    """

    ids: tuple[tuple[int, ...], ...]
    start_counts: bool

    @classmethod
    def forbidden(cls) -> None:
        """Return None: without groups there is nothing to check."""

    def checks(self, flown: FlownTour, /) -> list[Check]:
        """Return the check that no group is visited twice and each body is of a group."""
        group_of = {body: k for k, group in enumerate(self.ids, 1) for body in group}
        visited = [body.id for body in flown.bodies[0 if self.start_counts else 1 :]]
        groups = [group_of.get(body, 0) for body in visited]
        good = 0 not in groups and len(set(groups)) == len(groups)
        return [
            Check(
                "one body of each group",
                good,
                f"groups {', '.join(map(str, groups)) or 'none'}",
                f"1 to {len(self.ids)}, each once",
            )
        ]
