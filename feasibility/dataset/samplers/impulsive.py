"""Two-impulse transfers: their velocity change, and the flight time at which it is lowest."""

from typing import Annotated, Final, final

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from feasibility.constants import DAY_S
from feasibility.orbits import Catalogue
from feasibility.orbits.lambert import lambert

_Days = Annotated[float, Meta(gt=0)]

_LEGS_AT_A_TIME: Final = 64
"""A batch of the grid search then stays within a processor's second-level cache."""


@final
class ImpulsiveGrid(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Grid of flight times on which the cheapest impulsive transfer is looked for.

    Parameters
    ----------
    tof_days_min, tof_days_max : float
        Shortest and longest flight time, both on the grid (Table 1 of the paper: 60 and 4 * 365).
    step_days : float
        Step of the grid over the whole range.
    fine_step_days : float
        Step of the second grid, one `step_days` to either side of the best of the first.
    max_revolutions : int
        Lambert branches up to this number of complete revolutions are compared.
    """

    tof_days_min: _Days = 60.0
    tof_days_max: _Days = 1460.0
    step_days: _Days = 10.0
    fine_step_days: _Days = 1.0
    max_revolutions: Annotated[int, Meta(ge=0, le=5)] = 1

    def __post_init__(self) -> None:
        if self.tof_days_max < self.tof_days_min:
            raise ValueError(
                f"tof_days_max = {self.tof_days_max:g} is below "
                f"tof_days_min = {self.tof_days_min:g}"
            )
        if self.fine_step_days > self.step_days:
            raise ValueError(
                f"fine_step_days = {self.fine_step_days:g} is above step_days = {self.step_days:g}"
            )

    def coarse(self) -> NDArray[np.float64]:
        """Return the grid of flight times in days, both ends included."""
        steps = int(np.ceil((self.tof_days_max - self.tof_days_min) / self.step_days - 1e-9))
        grid = self.tof_days_min + self.step_days * np.arange(steps + 1, dtype=np.float64)
        grid[-1] = self.tof_days_max
        return grid

    def best_tof_days(
        self,
        catalogue: Catalogue,
        dep_rows: NDArray[np.int64],
        arr_rows: NDArray[np.int64],
        t_dep_mjd2000: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the flight time with the lowest Lambert velocity change, ``dt_imp``.

        Parameters
        ----------
        catalogue : Catalogue
            The bodies.
        dep_rows, arr_rows : (n,) int64
            Rows of the departure and the arrival body.
        t_dep_mjd2000 : (n,) float64
            Departure epochs.

        Returns
        -------
        (n,) float64
            Days, on the fine grid; the shortest time where several are equally good.
        """
        reach = round(self.step_days / self.fine_step_days)
        offsets = self.fine_step_days * np.arange(-reach, reach + 1)
        coarse = self.coarse()
        best = np.empty(len(dep_rows))
        for first in range(0, len(dep_rows), _LEGS_AT_A_TIME):
            part = slice(first, first + _LEGS_AT_A_TIME)
            pairs = catalogue, dep_rows[part], arr_rows[part], t_dep_mjd2000[part]
            times = np.broadcast_to(coarse, (len(pairs[1]), len(coarse)))
            for finer in (True, False):
                cost = self._costs(*pairs, times)
                chosen = np.take_along_axis(times, cost.argmin(axis=1)[:, None], axis=1)
                if finer:
                    times = np.clip(chosen + offsets, self.tof_days_min, self.tof_days_max)
            best[part] = chosen[:, 0]
        return best

    def _costs(
        self,
        catalogue: Catalogue,
        dep_rows: NDArray[np.int64],
        arr_rows: NDArray[np.int64],
        t_dep_mjd2000: NDArray[np.float64],
        tof_days: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return (n, k) m/s for (n, k) flight times; inf where no arc exists."""
        n, k = tof_days.shape
        departure = catalogue.states_at(dep_rows, t_dep_mjd2000)
        arrival = catalogue.states_at(
            np.repeat(arr_rows, k), (t_dep_mjd2000[:, None] + tof_days).ravel()
        )
        cost = lowest_delta_v(
            np.repeat(departure, k, axis=0), arrival, tof_days.ravel(), self.max_revolutions
        )
        return np.where(np.isnan(cost), np.inf, cost).reshape(n, k)


def lowest_delta_v(
    rv_dep: NDArray[np.float64],
    rv_arr: NDArray[np.float64],
    tof_days: NDArray[np.float64],
    max_revolutions: int,
) -> NDArray[np.float64]:
    """Return the velocity change of the best Lambert branch, both impulses together.

    Parameters
    ----------
    rv_dep, rv_arr : (n, 6) float64, m and m/s
        States at both ends.
    tof_days : (n,) float64
        Flight times.
    max_revolutions : int
        Branches up to this number of complete revolutions are compared.

    Returns
    -------
    (n,) float64, m/s
        NaN where no branch exists.
    """
    v1, v2 = lambert(rv_dep[:, :3], rv_arr[:, :3], tof_days * DAY_S, max_revolutions)
    v1 -= rv_dep[:, None, 3:]
    v2 -= rv_arr[:, None, 3:]
    cost = np.sqrt(np.einsum("nbi,nbi->nb", v1, v1)) + np.sqrt(np.einsum("nbi,nbi->nb", v2, v2))
    best: NDArray[np.float64] = np.fmin.reduce(cost, axis=1)
    return best
