"""Sampler of the legs that a tour search asks about: near neighbours, short flights."""

from typing import Annotated, ClassVar, final

import msgspec
import numpy as np
from msgspec import Meta
from numpy.random import Generator

from feasibility.constants import mjd_to_mjd2000
from feasibility.dataset.samplers.draws import Draw, check_pairs, check_ranges, legs_of_pairs
from feasibility.dataset.samplers.impulsive import ImpulsiveGrid
from feasibility.legs import Spacecraft
from feasibility.orbits import Catalogue, OrbitalNeighbours

_Positive = Annotated[float, Meta(gt=0)]
_Range = tuple[_Positive, _Positive]
_Count = Annotated[int, Meta(ge=1)]


@final
class SearchCandidates(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="search-candidates",
):
    """A body at random and one of its nearest neighbours in the orbital metric.

    Neighbourhoods need a tree of the whole catalogue for each epoch. So the
    legs of a shard share `epochs` departure epochs' neighbourhoods; each leg
    departs within `epoch_width_days` of one of them. Over the shards epochs
    are uniform in the window.

    Parameters
    ----------
    start_mjd : pair of float
        Departure epochs.
    m0_kg : pair of float
        Initial masses along a tour, uniform.
    tof_days : pair of float
        Flight times, uniform.
    long_tof_days : pair of float
        Flight times of the share `long_share`, uniform.
    long_share : float
        Share of longer flights.
    neighbours : int
        Targets are drawn evenly from this many nearest neighbours.
    reference_tof_days : float
        Transfer time in the orbital metric.
    epochs : int
        Neighbourhood epochs of a shard.
    epoch_width_days : float
        Departures scatter evenly over this width about a neighbourhood epoch.
    """

    draws_spacecraft: ClassVar[bool] = False

    start_mjd: _Range = (59215.0, 67249.5)
    m0_kg: _Range = (800.0, 2000.0)
    tof_days: _Range = (40.0, 400.0)
    long_tof_days: _Range = (400.0, 800.0)
    long_share: Annotated[float, Meta(ge=0, le=1)] = 0.1
    neighbours: _Count = 60
    reference_tof_days: _Positive = 180.0
    epochs: _Count = 40
    epoch_width_days: _Positive = 30.0

    def __post_init__(self) -> None:
        check_ranges(
            start_mjd=self.start_mjd,
            m0_kg=self.m0_kg,
            tof_days=self.tof_days,
            long_tof_days=self.long_tof_days,
        )

    def draw(
        self,
        n: int,
        rng: Generator,
        catalogue: Catalogue,
        spacecraft: Spacecraft | None,
        grid: ImpulsiveGrid,
    ) -> Draw:
        """Draw `n` legs.

        Raises
        ------
        InputError
            The catalogue has no more bodies than `neighbours`.
        """
        assert spacecraft is not None
        check_pairs(catalogue)
        first, last = (mjd_to_mjd2000(mjd) for mjd in self.start_mjd)
        width = self.epoch_width_days
        nearby = OrbitalNeighbours(catalogue, self.reference_tof_days, bucket_days=width)
        # Neighbourhoods are those of the buckets that the epochs fall into.
        centres = width * np.rint(rng.uniform(first, last, self.epochs) / width)
        t_dep = rng.choice(centres, n) + width * rng.uniform(-0.5, 0.5, n)
        t_dep = np.clip(t_dep, first, last)
        dep = rng.integers(0, len(catalogue), n)
        found = nearby.query(dep, t_dep, self.neighbours)
        arr = found[np.arange(n), rng.integers(0, self.neighbours, n)]
        tof = rng.uniform(*self.tof_days, n)
        long_tof = rng.uniform(*self.long_tof_days, n)
        tof = np.where(rng.uniform(size=n) < self.long_share, long_tof, tof)
        rows = {"dep": dep, "arr": arr, "t_dep": t_dep, "tof": tof}
        legs = legs_of_pairs(catalogue, rows, rng.uniform(*self.m0_kg, n), spacecraft)
        dt_imp = grid.best_tof_days(catalogue, dep, arr, t_dep)
        low, high = (np.full(n, bound) for bound in self.m0_kg)
        return Draw(legs, dt_imp, low, high)
