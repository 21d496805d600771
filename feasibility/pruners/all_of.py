"""`AllOf`: several pruners, one after the other."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.legs import Legs
from feasibility.pruners.asking import ask
from feasibility.pruners.classifier import ClassifierPruner
from feasibility.pruners.protocol import Pruner


@final
@dataclass(frozen=True, eq=False)
class Survivors:
    """What several pruners say of n legs.

    Attributes
    ----------
    mask : (n,) bool
        True where the leg survives all pruners.
    unknown : (n,) bool
        True where it does, and a classifier kept it for not knowing it.
    pruned : dict of str to int
        How many legs each pruner dropped, by its name, in the order in which they were
        asked; the second pruner of the same name is called ``name-2``, and so on.
    """

    mask: NDArray[np.bool_]
    unknown: NDArray[np.bool_]
    pruned: dict[str, int]


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
        return self.survivors(legs).mask

    def keep_with_unknown(self, legs: Legs, /) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return the masks of `survivors`; compare `ClassifierPruner.keep_with_unknown`."""
        found = self.survivors(legs)
        return found.mask, found.unknown

    def survivors(self, legs: Legs, /) -> Survivors:
        """Return what survives, what of it is not known, and who dropped how many, at once.

        Raises
        ------
        PrunerContractError
            A pruner raised, or returned something else than a boolean a leg.
        """
        mask = np.ones(len(legs), dtype=np.bool_)
        unknown = np.zeros(len(legs), dtype=np.bool_)
        pruned: dict[str, int] = {}
        for pruner in self.pruners:
            rows = np.flatnonzero(mask)
            if isinstance(pruner, AllOf | ClassifierPruner):
                kept, in_the_dark = pruner.keep_with_unknown(legs.take(rows))
                unknown[rows] |= in_the_dark
            else:
                kept = ask(pruner, legs.take(rows))
            mask[rows] = kept
            pruned[_unused(pruner_name(pruner), pruned)] = len(rows) - int(np.count_nonzero(kept))
        return Survivors(mask, unknown & mask, pruned)


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
