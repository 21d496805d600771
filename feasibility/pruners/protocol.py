"""The `Pruner` protocol: what a search asks of anything that prunes."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from feasibility.legs import Legs


@runtime_checkable
class Pruner(Protocol):
    """Decides which candidate legs are worth a full optimisation.

    The contract, which `feasibility.check_pruner` tests:

    - one boolean a leg, True where the leg survives;
    - row-wise: the answer for a leg depends on that leg alone, not on its
      position or its neighbours, so that a search may split and merge batches;
    - pure: the same legs get the same answer, and the legs are not changed;
    - an answer that is all False is legal, and so is a batch without legs: `check_pruner`
      asks about one, but no search does, so that a model which refuses it works there;
    - picklable, so that it can travel to worker processes.

    Examples
    --------
    A pruner of one's own is any object with this method:

    >>> import numpy as np
    >>> class ShortHops:
    ...     def keep(self, legs, /):
    ...         return legs.tof_days < 300.0
    >>> isinstance(ShortHops(), Pruner)
    True
    """

    def keep(self, legs: Legs, /) -> NDArray[np.bool_]:
        """Return (n,) bool, True where the leg survives."""
        ...
