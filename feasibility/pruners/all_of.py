"""`AllOf`: several pruners, one after the other."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.legs import Legs
from feasibility.pruners.asking import ask
from feasibility.pruners.protocol import Pruner


@final
@dataclass(frozen=True, init=False)
class AllOf:
    """Keeps a leg that all its pruners keep; each is asked only about survivors.

    Put the cheap ones first.

    Parameters
    ----------
    *pruners : Pruner
        In the order in which they are asked. None at all keeps everything.

    Examples
    --------
    >>> from feasibility.pruners.keep_all import KeepAll
    >>> AllOf(KeepAll(), KeepAll()).name
    'all-of(keep-all, keep-all)'
    """

    pruners: tuple[Pruner, ...]

    def __init__(self, *pruners: Pruner) -> None:
        object.__setattr__(self, "pruners", pruners)

    @property
    def name(self) -> str:
        """Name in counters and reports."""
        return f"all-of({', '.join(pruner_name(pruner) for pruner in self.pruners)})"

    def keep(self, legs: Legs, /) -> NDArray[np.bool_]:
        """Return (n,) bool, True where the leg survives all pruners."""
        return self.keep_with_counts(legs)[0]

    def keep_with_counts(self, legs: Legs, /) -> tuple[NDArray[np.bool_], dict[str, int]]:
        """Return the mask of `keep` and how many legs each pruner dropped.

        Returns
        -------
        mask : (n,) bool
        pruned : dict of str to int
            By pruner name, in the order in which they were asked; the second
            pruner of the same name is called ``name-2``, and so on.

        Raises
        ------
        PrunerContractError
            A pruner raised, or returned something else than a boolean a leg.
        """
        mask = np.ones(len(legs), dtype=np.bool_)
        pruned: dict[str, int] = {}
        for pruner in self.pruners:
            rows = np.flatnonzero(mask)
            kept = ask(pruner, legs.take(rows))
            mask[rows] = kept
            pruned[_unused(pruner_name(pruner), pruned)] = len(rows) - int(np.count_nonzero(kept))
        return mask, pruned


def pruner_name(pruner: Pruner) -> str:
    """Return the pruner's `name`, or the name of its class where it has none."""
    name = getattr(pruner, "name", None)
    return name if isinstance(name, str) else type(pruner).__name__


def _unused(name: str, taken: dict[str, int]) -> str:
    candidate, number = name, 1
    while candidate in taken:
        number += 1
        candidate = f"{name}-{number}"
    return candidate
