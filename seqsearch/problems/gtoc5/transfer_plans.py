"""`TransferPlans`: predicted transfers to next rendezvous, one row a transfer."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.arrays import StructOfArrays

_Array = NDArray[np.float64]


@final
@dataclass(frozen=True, eq=False)
class TransferPlans(StructOfArrays):
    """Transfers from a node to next rendezvous, and the self-fly-bys before them.

    With n the number of transfers.

    Attributes
    ----------
    target : (n,) intp
        Catalogue row of the body.
    fly_by_days : (n,) float64
        Time of the self-fly-by before the transfer; 0 at the launch.
    velocity : (n, 3) float64, m/s
        At the departure of the transfer, relative to the body that is left:
        that of the launch or of the fly-by.
    tof_days : (n,) float64
        Time of the transfer.
    """

    target: NDArray[np.intp]
    fly_by_days: _Array
    velocity: _Array
    tof_days: _Array
