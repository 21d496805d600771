"""Sampler of transfers between planets and catalogue bodies, of any number of turns."""

from typing import Annotated, ClassVar, Final, Literal, final

import msgspec
import numpy as np
from msgspec import Meta
from numpy.random import Generator
from numpy.typing import NDArray

from feasibility.constants import AU, DAY_S, MU_SUN, mjd_to_mjd2000
from feasibility.dataset.samplers.draws import (
    Columns,
    Draw,
    check_pairs,
    check_ranges,
    collect,
    log_uniform,
)
from feasibility.dataset.samplers.impulsive import ImpulsiveGrid
from feasibility.legs import Legs, Spacecraft
from feasibility.orbits import Catalogue, earth

_Positive = Annotated[float, Meta(gt=0)]
_Range = tuple[_Positive, _Positive]
End = Literal["earth", "mars", "catalogue"]
_Ends = Annotated[tuple[End, ...], Meta(min_length=1)]

_MARS: Final = Catalogue(
    ids=[-1],
    names=["Mars"],
    epoch_mjd2000=0.5,
    # Mean elements at J2000 of Standish's table for 1800 to 2050 (JPL).
    elements=[
        [
            1.52371034 * AU,
            0.09339410,
            *np.radians([1.84969142, 49.55953891, -73.5031685, 19.39019754]),
        ]
    ],
    source="Mars",
)


@final
class Transfers(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="transfers",
):
    """Legs between the Earth, Mars and the catalogue's bodies; each has a spacecraft of its own.

    Launches, returns and flights of several turns, which the other samplers do not draw. With
    ``margin_range`` in the protocol the initial mass follows from m*; the acceleration given
    here only says how heavy or light it may become.

    Parameters
    ----------
    departures, arrivals : list of "earth", "mars", "catalogue"
        Where legs begin and end, each as likely; a body named twice is twice as likely.
        Pairs of a body with itself are drawn again.
    start_mjd : pair of float
        Departure epochs, uniform.
    revolutions : pair of float
        Flight times in turns at the mean of both bodies' mean motions, uniform.
    tof_days : pair of float
        Shortest and longest flight time; legs beyond are drawn again.
    acceleration_m_s2 : pair of float
        Thrust over initial mass, log-uniform.
    isp_s : pair of float
        Specific impulse, log-uniform.
    m0_kg : pair of float
        Initial mass, log-uniform.
    """

    draws_spacecraft: ClassVar[bool] = True

    departures: _Ends = ("earth", "catalogue")
    arrivals: _Ends = ("earth", "catalogue")
    start_mjd: _Range = (58849.0, 73459.0)
    revolutions: _Range = (0.2, 4.0)
    tof_days: _Range = (40.0, 10_000.0)
    acceleration_m_s2: _Range = (1e-6, 9e-3)
    isp_s: _Range = (1000.0, 6000.0)
    m0_kg: _Range = (1000.0, 1000.0)

    def __post_init__(self) -> None:
        check_ranges(
            start_mjd=self.start_mjd,
            revolutions=self.revolutions,
            tof_days=self.tof_days,
            acceleration_m_s2=self.acceleration_m_s2,
            isp_s=self.isp_s,
            m0_kg=self.m0_kg,
        )

    def draw(
        self,
        n: int,
        rng: Generator,
        catalogue: Catalogue,
        spacecraft: Spacecraft | None,  # noqa: ARG002
        grid: ImpulsiveGrid,  # noqa: ARG002
    ) -> Draw:
        """Draw `n` legs; ids of planets are -1, dt_imp is not defined (NaN).

        Raises
        ------
        InputError
            The catalogue has fewer than two bodies, or hardly a leg is within the limits.
        """
        check_pairs(catalogue)

        def batch(m: int) -> Columns:
            return self._batch(m, rng, catalogue)

        rows = collect(n, batch)
        m0 = log_uniform(rng, self.m0_kg, n)
        thrust = m0 * log_uniform(rng, self.acceleration_m_s2, n)
        slowest, fastest = self.acceleration_m_s2
        legs = Legs(
            rv_dep=rows["rv_dep"],
            rv_arr=rows["rv_arr"],
            tof_days=rows["tof"],
            m0=m0,
            thrust=thrust,
            isp=log_uniform(rng, self.isp_s, n),
            m_dry=0.0,
            t_dep_mjd2000=rows["t_dep"],
            dep_id=rows["dep_id"],
            arr_id=rows["arr_id"],
        )
        return Draw(legs, np.full(n, np.nan), thrust / fastest, thrust / slowest)

    def _batch(self, m: int, rng: Generator, catalogue: Catalogue) -> Columns:
        """Draw m candidates and return those between two bodies and within the flight times."""
        planets = {"earth": earth(), "mars": _MARS}
        dep = np.asarray(self.departures)[rng.integers(0, len(self.departures), m)]
        arr = np.asarray(self.arrivals)[rng.integers(0, len(self.arrivals), m)]
        dep_row, arr_row = rng.integers(0, len(catalogue), (2, m))
        t_dep = mjd_to_mjd2000(0.0) + rng.uniform(*self.start_mjd, m)
        turns = rng.uniform(*self.revolutions, m)
        same = (dep == arr) & ((dep != "catalogue") | (dep_row == arr_row))

        def column(values: Columns, kind: NDArray[np.str_]) -> NDArray[np.float64]:
            return np.select([kind == name for name in values], list(values.values()))

        def motion(kind: NDArray[np.str_], row: NDArray[np.int64]) -> NDArray[np.float64]:
            axes = {name: np.full(m, body.elements[0, 0]) for name, body in planets.items()}
            axes["catalogue"] = catalogue.elements[row, 0]
            motions: NDArray[np.float64] = np.sqrt(MU_SUN / column(axes, kind) ** 3)
            return motions

        tof = 4.0 * np.pi * turns / (motion(dep, dep_row) + motion(arr, arr_row)) / DAY_S
        kept = ~same & (tof >= self.tof_days[0]) & (tof <= self.tof_days[1])
        columns: Columns = {"tof": tof[kept], "t_dep": t_dep[kept]}
        ends = {"dep": (dep, dep_row, t_dep), "arr": (arr, arr_row, t_dep + tof)}
        for end, (kind, row, epoch) in ends.items():
            states = np.empty((m, 6))
            ids = np.full(m, -1, dtype=np.int64)
            for name, body in {**planets, "catalogue": catalogue}.items():
                here = kind == name
                rows = row[here] if name == "catalogue" else np.zeros(here.sum(), dtype=np.int64)
                states[here] = body.states_at(rows, epoch[here])
                if name == "catalogue":
                    ids[here] = catalogue.ids[rows]
            columns |= {f"rv_{end}": states[kept], f"{end}_id": ids[kept]}
        return columns
