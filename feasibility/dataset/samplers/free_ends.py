"""`FreeEnds`: how a sampler draws the largest excess velocities of its legs."""

from typing import Annotated, final

import msgspec
import numpy as np
from msgspec import Meta
from numpy.random import Generator
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.dataset.samplers.draws import check_ranges

_Share = Annotated[float, Meta(ge=0, le=1)]
_Positive = Annotated[float, Meta(gt=0)]


@final
class FreeEnds(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Which ends of drawn legs are free, and by how much.

    Parameters
    ----------
    departures, arrivals : float
        Shares of legs whose end is free.
    any_speed : float
        Of the free arrivals this share has no bound at all: a fly-by at any speed.
    excess_of_circular : pair of float
        Bounds of the others over the circular speed at that place, log-uniform.
    """

    departures: _Share = 0.0
    arrivals: _Share = 0.0
    any_speed: _Share = 0.5
    excess_of_circular: tuple[_Positive, _Positive] = (0.005, 0.3)

    def __post_init__(self) -> None:
        check_ranges(excess_of_circular=self.excess_of_circular)

    def draw(
        self, rng: Generator, rv_dep: NDArray[np.float64], rv_arr: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (n,) m/s, the largest excess velocities at departure and arrival."""
        n = len(rv_dep)
        low, high = np.log(self.excess_of_circular)
        ends = []
        for rv, share in ((rv_dep, self.departures), (rv_arr, self.arrivals)):
            circular = np.sqrt(MU_SUN / np.linalg.norm(rv[:, :3], axis=1))
            bound = circular * np.exp(rng.uniform(low, high, n))
            ends.append(np.where(rng.uniform(size=n) < share, bound, 0.0))
        open_ = (rng.uniform(size=n) < self.any_speed) & (ends[1] > 0.0)
        return ends[0], np.where(open_, np.inf, ends[1])
