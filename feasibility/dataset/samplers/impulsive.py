"""`ImpulsiveGrid`: the flight time at which the two-impulse transfer is cheapest."""

from typing import Annotated, Final, final

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from feasibility.constants import DAY_S, MU_SUN
from feasibility.orbits import Catalogue

_Days = Annotated[float, Meta(gt=0)]

_MAX_STEPS: Final = 100_000


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
        if self.tof_days_max > _MAX_STEPS * self.fine_step_days:
            raise ValueError(
                f"tof_days_max = {self.tof_days_max:g} in steps of {self.fine_step_days:g} days, "
                f"expected at most {_MAX_STEPS}"
            )
        if self.fine_step_days > self.step_days:
            raise ValueError(
                f"fine_step_days = {self.fine_step_days:g} is above step_days = {self.step_days:g}"
            )

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
        from feasibility.orbits.impulsive_kernels import cheapest_tof_batch

        best: NDArray[np.float64] = cheapest_tof_batch(
            catalogue.states_at(dep_rows, t_dep_mjd2000),
            catalogue.states_at(arr_rows, t_dep_mjd2000),
            np.zeros(len(dep_rows)),
            self.tof_days_min * DAY_S,
            self.tof_days_max * DAY_S,
            self.step_days * DAY_S,
            self.fine_step_days * DAY_S,
            self.max_revolutions,
            MU_SUN,
        )
        return best / DAY_S
