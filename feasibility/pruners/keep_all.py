"""`KeepAll`: the pruner that prunes nothing."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.legs import Legs


@final
@dataclass(frozen=True)
class KeepAll:
    """Keeps every leg: the baseline, and the default where no pruner is given.

    Examples
    --------
    >>> KeepAll().name
    'keep-all'
    """

    @property
    def name(self) -> str:
        """Name in counters and reports."""
        return "keep-all"

    def keep(self, legs: Legs, /) -> NDArray[np.bool_]:
        """Return (n,) True."""
        return np.ones(len(legs), dtype=np.bool_)
