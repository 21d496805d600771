"""`keep_hops`: which hops survive pruning, and what each pruner dropped."""

from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility import AllOf
from seqsearch.core.hops import Hops


@final
@dataclass(frozen=True, eq=False)
class KeptHops:
    """What pruners say of n hops.

    Attributes
    ----------
    mask : (n,) bool
        Which hops survive: those of which all legs do.
    pruned : dict of str to int
        Legs dropped by each pruner, in the order in which they were asked.
    out_of_domain : int
        Hops that survive because a classifier does not know such legs.
    """

    mask: NDArray[np.bool_]
    pruned: dict[str, int] = field(default_factory=dict)
    out_of_domain: int = 0


def keep_hops(pruner: AllOf, hops: Hops) -> KeptHops:
    """Ask pruners about hops; each leg is asked about only where the legs before survive."""
    mask = np.ones(len(hops), dtype=np.bool_)
    unknown = np.zeros(len(hops), dtype=np.bool_)
    pruned: dict[str, int] = {}
    for legs in hops.legs:
        rows = np.flatnonzero(mask)
        answer = pruner.survivors(legs.take(rows))
        mask[rows] = answer.mask
        unknown[rows] |= answer.unknown
        for name, count in answer.pruned.items():
            pruned[name] = pruned.get(name, 0) + count
    return KeptHops(mask, pruned, int(np.count_nonzero(unknown & mask)))
