"""Kinds of legs with free ends: each has a calibration and thresholds of its own."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.legs import Legs

KINDS: Final = (
    "free departure",
    "free arrival",
    "both ends free",
    "fly-by",
    "fly-by after a free departure",
)
"""Names of the kinds, in the order of their numbers."""


def kinds_of_ends(legs: Legs) -> NDArray[np.intp]:
    """Return (n,) the number of each leg's kind, a row of `KINDS`; -1 for a rendezvous.

    A fly-by has no bound at all on its speed at arrival.
    """
    departure = legs.vinf_dep > 0.0
    arrival = (legs.vinf_arr > 0.0).astype(np.intp) + np.isinf(legs.vinf_arr)
    return np.asarray(2 * arrival + departure - 1, dtype=np.intp)
