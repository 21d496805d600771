"""Sampler of random pairs of a catalogue: Table 1 of the paper, and pairs of similar orbits."""

from typing import Annotated, ClassVar, final

import msgspec
import numpy as np
from msgspec import Meta
from numpy.random import Generator
from numpy.typing import NDArray

from feasibility.constants import mjd_to_mjd2000
from feasibility.dataset.samplers.draws import (
    Columns,
    Draw,
    check_pairs,
    check_ranges,
    collect,
    legs_of_pairs,
)
from feasibility.dataset.samplers.impulsive import ImpulsiveGrid
from feasibility.legs import Spacecraft
from feasibility.orbits import Catalogue

_Positive = Annotated[float, Meta(gt=0)]
_Range = tuple[_Positive, _Positive]


@final
class RandomPairs(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="random-pairs",
):
    """Two different bodies at random; the flight time follows the cheapest impulsive transfer.

    Table 1 of the paper: the low-thrust flight time is uniform in
    [1.2 dt_imp, min(2 dt_imp, 4 * 365 days)]. Where 1.2 dt_imp is beyond the upper
    end that interval is empty, and the pair and its epoch are drawn again.

    Parameters
    ----------
    start_mjd : pair of float
        Departure epochs, uniform (1 Jan 2020 to 1 Jan 2060).
    m0_kg : pair of float
        Initial masses, uniform.
    tof_ratio : pair of float
        Flight time over dt_imp.
    tof_days_max : float
        Longest flight time.
    max_de, max_di_deg : float, optional
        Largest differences of eccentricity and inclination of a pair.
    """

    draws_spacecraft: ClassVar[bool] = False

    start_mjd: _Range = (58849.0, 73459.0)
    m0_kg: _Range = (1000.0, 3000.0)
    tof_ratio: _Range = (1.2, 2.0)
    tof_days_max: _Positive = 1460.0
    max_de: _Positive | None = None
    max_di_deg: _Positive | None = None

    def __post_init__(self) -> None:
        check_ranges(start_mjd=self.start_mjd, m0_kg=self.m0_kg, tof_ratio=self.tof_ratio)

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
            The catalogue has fewer than two bodies, or hardly a pair within the limits.
        """
        assert spacecraft is not None
        check_pairs(catalogue)

        def batch(m: int) -> Columns:
            return self._batch(m, rng, catalogue, grid)

        rows = collect(n, batch)
        m0 = rng.uniform(*self.m0_kg, n)
        legs = legs_of_pairs(catalogue, rows, m0, spacecraft)
        low, high = (np.full(n, bound) for bound in self.m0_kg)
        return Draw(legs, rows["dt_imp"], low, high)

    def _batch(self, m: int, rng: Generator, catalogue: Catalogue, grid: ImpulsiveGrid) -> Columns:
        dep = rng.integers(0, len(catalogue), m)
        # An offset that is never zero: the two bodies differ and all pairs are equally likely.
        arr = (dep + rng.integers(1, len(catalogue), m)) % len(catalogue)
        t_dep = mjd_to_mjd2000(0.0) + rng.uniform(*self.start_mjd, m)
        similar = self._similar(catalogue, dep, arr)
        dep, arr, t_dep = dep[similar], arr[similar], t_dep[similar]
        dt_imp = grid.best_tof_days(catalogue, dep, arr, t_dep)
        low, high = self.tof_ratio
        shortest = low * dt_imp
        longest = np.minimum(high * dt_imp, self.tof_days_max)
        tof = shortest + (longest - shortest) * rng.uniform(size=len(dep))
        possible = shortest <= longest
        columns = {"dep": dep, "arr": arr, "t_dep": t_dep, "dt_imp": dt_imp, "tof": tof}
        return {name: column[possible] for name, column in columns.items()}

    def _similar(
        self, catalogue: Catalogue, dep: NDArray[np.int64], arr: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        difference = np.abs(catalogue.elements[dep] - catalogue.elements[arr])
        similar = np.ones(len(dep), dtype=np.bool_)
        if self.max_de is not None:
            similar &= difference[:, 1] <= self.max_de
        if self.max_di_deg is not None:
            similar &= difference[:, 2] <= np.radians(self.max_di_deg)
        return similar
