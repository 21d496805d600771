"""`Spacecraft` and `Legs`: the vocabulary that every other part exchanges."""

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Self, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import DAY_S, G0
from feasibility.errors import InputError
from feasibility.leg_checks import check_excess, check_finite, check_state
from feasibility.quantities import plain_numbers

_MAX_TOF_DAYS = 1e5
_MAX_THRUST_N = 1e3
_MAX_ISP_S = 2e4
_MAX_MASS_KG = 1e7
_MAX_ACCELERATION = 0.01
"""m/s2: electric spacecraft have 1e-5 to 1e-3, so that a thrust in mN is found."""
_MAX_DRY_ACCELERATION = 0.02
"""m/s2, of the dry mass alone: legs are flown with more."""
_SURELY_MILLINEWTON = 10.0

_UNITS = {
    "rv_dep": ("m", "m", "m", "m/s", "m/s", "m/s"),
    "rv_arr": ("m", "m", "m", "m/s", "m/s", "m/s"),
    "tof_days": ("day",),
    "m0": ("kg",),
    "thrust": ("N",),
    "isp": ("s",),
    "m_dry": ("kg",),
    "t_dep_mjd2000": ("day",),
    "vinf_dep": ("m/s",),
    "vinf_arr": ("m/s",),
}
"""What quantities with units are converted to; ids have none."""


@final
@dataclass(frozen=True)
class Spacecraft:
    """A spacecraft with electric propulsion at constant thrust and specific impulse.

    Quantities with units (astropy, pint) are converted.

    Parameters
    ----------
    m_dry : float
        Dry mass in kg, zero or more: the least final mass of a leg.
    thrust : float
        Maximum thrust in N.
    isp : float
        Specific impulse in s.

    Raises
    ------
    InputError
        A value is no number, not finite, not positive, or evidently in another unit, such as a
        thrust in mN: it would accelerate the dry mass by more than 0.02 m/s2.

    Examples
    --------
    >>> probe = Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0)
    >>> round(probe.exhaust_velocity)
    29420
    """

    m_dry: float
    thrust: float
    isp: float

    def __post_init__(self) -> None:
        for name in ("m_dry", "thrust", "isp"):
            label = f"Spacecraft {name}"
            try:
                plain = plain_numbers(label, getattr(self, name), _UNITS[name])
                value = np.asarray(plain, dtype=float)
            except (TypeError, ValueError) as error:
                if isinstance(error, InputError):
                    raise
                raise InputError(f"{label}: expected a number ({error})") from None
            if value.ndim:
                raise InputError(f"{label}: expected one number, got shape {value.shape}")
            _check_scalar_column(label, value.reshape(1), name)
            object.__setattr__(self, name, float(value))
        if self.m_dry > 0.0:
            fault = acceleration_fault(self.thrust, self.m_dry, _MAX_DRY_ACCELERATION)
            if fault is not None:
                raise InputError(f"Spacecraft thrust: {fault}")

    @property
    def exhaust_velocity(self) -> float:
        """Effective exhaust velocity isp * g0 in m/s."""
        return self.isp * G0


@final
@dataclass(frozen=True, eq=False, repr=False)
class Legs:
    """Many legs as a frozen struct of arrays, one row a leg.

    With n the number of legs; scalars and single rows are broadcast to n.
    Arrays are copied once, validated once and made read-only. Quantities with units (astropy,
    pint) are converted; of states, which have two units, only rows of single quantities are.

    Parameters
    ----------
    rv_dep, rv_arr : array_like
        (n, 6) float64, m and m/s: heliocentric state of the departure body at
        departure and of the arrival body at arrival. The leg is a rendezvous
        at both ends, but for the excess velocities below.
    tof_days : array_like
        (n,) float64: time of flight in days.
    m0 : array_like
        (n,) float64, kg: initial mass.
    thrust : array_like
        (n,) float64, N: maximum thrust.
    isp : array_like
        (n,) float64, s: specific impulse.
    m_dry : array_like
        (n,) float64, kg: dry mass, zero or more and at most `m0`.
    t_dep_mjd2000 : array_like, optional
        (n,) float64: departure epoch. Not used by the dynamics.
    dep_id, arr_id : array_like, optional
        (n,) int64: ids of the bodies. Not used by the dynamics.
    vinf_dep, vinf_arr : array_like
        (n,) float64, m/s: by how much the velocity at departure may differ from that of
        `rv_dep`, and at arrival from that of `rv_arr`, in any direction and for free. 0, as
        unless given, is a rendezvous; `numpy.inf` asks for the position only (a fly-by at any
        speed); a launch has `vinf_dep`, an unloading with some speed left `vinf_arr`. Where the
        largest of all these values is from 0.1 to 20 m/s, they are taken for km/s and refused.

    Raises
    ------
    InputError
        A shape does not fit, a value is not finite or not positive, or a
        column is evidently in another unit (a position in AU or km, a
        velocity or an excess velocity in km/s, a time in seconds, a thrust in mN: one that
        accelerates m0 by more than 0.01 m/s2). The message names the column and the first bad row.

    Examples
    --------
    >>> craft = Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0)
    >>> legs = Legs(
    ...     rv_dep=[4.0e11, 0, 0, 0, 1.8e4, 0],
    ...     rv_arr=[[0, 4.1e11, 0, -1.8e4, 0, 0], [0, 4.2e11, 0, -1.8e4, 0, 0]],
    ...     tof_days=[400.0, 410.0],
    ...     m0=2000.0,
    ...     thrust=craft.thrust,
    ...     isp=craft.isp,
    ...     m_dry=craft.m_dry,
    ... )
    >>> len(legs)
    2
    """

    rv_dep: NDArray[np.float64]
    rv_arr: NDArray[np.float64]
    tof_days: NDArray[np.float64]
    m0: NDArray[np.float64]
    thrust: NDArray[np.float64]
    isp: NDArray[np.float64]
    m_dry: NDArray[np.float64]
    t_dep_mjd2000: NDArray[np.float64] | None = None
    dep_id: NDArray[np.int64] | None = None
    arr_id: NDArray[np.int64] | None = None
    vinf_dep: NDArray[np.float64] = dataclasses.field(kw_only=True)
    vinf_arr: NDArray[np.float64] = dataclasses.field(kw_only=True)

    def __init__(
        self,
        rv_dep: ArrayLike,
        rv_arr: ArrayLike,
        tof_days: ArrayLike,
        m0: ArrayLike,
        thrust: ArrayLike,
        isp: ArrayLike,
        m_dry: ArrayLike,
        *,
        t_dep_mjd2000: ArrayLike | None = None,
        dep_id: ArrayLike | None = None,
        arr_id: ArrayLike | None = None,
        vinf_dep: ArrayLike = 0.0,
        vinf_arr: ArrayLike = 0.0,
    ) -> None:
        given = {
            "rv_dep": rv_dep,
            "rv_arr": rv_arr,
            "tof_days": tof_days,
            "m0": m0,
            "thrust": thrust,
            "isp": isp,
            "m_dry": m_dry,
            "t_dep_mjd2000": t_dep_mjd2000,
            "dep_id": dep_id,
            "arr_id": arr_id,
            "vinf_dep": vinf_dep,
            "vinf_arr": vinf_arr,
        }
        optional = ("t_dep_mjd2000", "dep_id", "arr_id")
        arrays = {
            name: _as_array(name, value)
            for name, value in given.items()
            if value is not None or name not in optional
        }
        n = _common_length(arrays)
        for name in given:
            column = _broadcast(name, arrays[name], n) if name in arrays else None
            object.__setattr__(self, name, column)
        self._validate()

    def __len__(self) -> int:
        return len(self.tof_days)

    def __repr__(self) -> str:
        return f"Legs(n={len(self)})"

    @property
    def tof_s(self) -> NDArray[np.float64]:
        """(n,) time of flight in seconds."""
        return self.tof_days * DAY_S

    @property
    def exhaust_velocity(self) -> NDArray[np.float64]:
        """(n,) effective exhaust velocity isp * g0 in m/s."""
        return self.isp * G0

    @property
    def free_ends(self) -> NDArray[np.bool_]:
        """(n,) whether a velocity may differ from the body's at one end or both."""
        return np.asarray((self.vinf_dep > 0.0) | (self.vinf_arr > 0.0))

    def take(self, rows: ArrayLike | slice) -> Self:
        """Return the legs at the given rows (indices or a boolean mask), in that order.

        Those of a slice share memory with these legs.
        """
        if isinstance(rows, slice):
            return self._trusted({name: column[rows] for name, column in self._columns()})
        index = np.asarray(rows)
        if index.size == 0:
            index = index.astype(np.intp)
        return self._trusted({name: column[index] for name, column in self._columns()})

    def with_m0(self, m0: ArrayLike) -> Self:
        """Return the same legs with other initial masses.

        Parameters
        ----------
        m0 : array_like
            (n,) kg, or one value for all; at least the dry mass.

        Raises
        ------
        InputError
            As for the constructor.
        """
        columns = dict(self._columns())
        columns["m0"] = _broadcast("m0", _as_array("m0", m0), len(self))
        legs = self._trusted(columns)
        legs._validate_masses()
        return legs

    @classmethod
    def concatenate(cls, parts: Sequence["Legs"]) -> "Legs":
        """Return the rows of all parts, in order; optional columns only if all parts have them.

        Raises
        ------
        InputError
            `parts` is empty.
        """
        if not parts:
            raise InputError("Legs.concatenate: expected at least one part, got none")
        columns = {}
        for field in dataclasses.fields(cls):
            values = [getattr(part, field.name) for part in parts]
            if all(value is not None for value in values):
                columns[field.name] = np.concatenate(values)
        return cls._trusted(columns)

    def _columns(self) -> Iterator[tuple[str, NDArray[Any]]]:
        for field in dataclasses.fields(self):
            column = getattr(self, field.name)
            if column is not None:
                yield field.name, column

    @classmethod
    def _trusted(cls, columns: dict[str, NDArray[Any]]) -> Self:
        """Build from columns that were validated before: selections of valid legs are valid."""
        legs = cls.__new__(cls)
        for field in dataclasses.fields(cls):
            column = columns.get(field.name)
            if column is not None:
                column.flags.writeable = False
            object.__setattr__(legs, field.name, column)
        return legs

    def _validate(self) -> None:
        check_state("rv_dep", self.rv_dep)
        check_state("rv_arr", self.rv_arr)
        for name in ("tof_days", "thrust", "isp"):
            _check_scalar_column(f"Legs {name}", getattr(self, name), name)
        self._validate_masses()
        self._validate_acceleration()
        if self.t_dep_mjd2000 is not None:
            check_finite("Legs t_dep_mjd2000", self.t_dep_mjd2000)
        check_excess({name: getattr(self, name) for name in ("vinf_dep", "vinf_arr")})

    def _validate_masses(self) -> None:
        _check_scalar_column("Legs m0", self.m0, "m0")
        _check_scalar_column("Legs m_dry", self.m_dry, "m_dry")
        bad = self.m0 < self.m_dry
        if bad.any():
            row = int(np.argmax(bad))
            raise InputError(
                f"Legs m0, row {row}: {self.m0[row]:g} kg is below the dry mass of "
                f"{self.m_dry[row]:g} kg"
            )

    def _validate_acceleration(self) -> None:
        bad = self.thrust > _MAX_ACCELERATION * self.m0
        if bad.any():
            row = int(np.argmax(bad))
            fault = acceleration_fault(self.thrust[row], self.m0[row])
            raise InputError(f"Legs thrust, row {row}: {fault}")


def acceleration_fault(
    thrust_n: float, mass_kg: float, most: float = _MAX_ACCELERATION
) -> str | None:
    """Return what is wrong with a thrust on a mass, None if it accelerates as electric ones do.

    Parameters
    ----------
    thrust_n, mass_kg : float
        The thrust in N and the mass, more than zero, in kg.
    most : float
        Largest acceleration in m/s2.
    """
    if thrust_n <= most * mass_kg:
        return None
    # A small thrust may be right, and the mass be in tonnes.
    sure = thrust_n >= _SURELY_MILLINEWTON
    slip = "is it in mN?" if sure else "is the thrust in mN, or the mass in t?"
    return (
        f"{thrust_n:g} N on {mass_kg:g} kg is {thrust_n / mass_kg:.2g} m/s2, "
        f"expected at most {most:g} m/s2; {slip}"
    )


def _as_array(name: str, value: ArrayLike | None) -> NDArray[Any]:
    label = f"Legs {name}"
    if value is None:
        raise InputError(f"{label}: is None; expected numbers")
    plain = plain_numbers(label, value, _UNITS.get(name, ()))
    dtype = np.int64 if name in ("dep_id", "arr_id") else np.float64
    try:
        array = np.array(plain, dtype=dtype)
        # numpy cuts fractions off without a word.
        whole = dtype is np.float64 or np.asarray(plain).dtype.kind in "iu"
        if not whole and not np.array_equal(array, np.asarray(plain, dtype=np.float64)):
            raise InputError(f"{label}: expected whole numbers")
    except (TypeError, ValueError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"Legs {name}: expected numbers ({error})") from None
    if name in ("rv_dep", "rv_arr"):
        if array.ndim == 1:
            array = array.reshape(1, -1)
        if array.ndim != 2 or array.shape[1] != 6:
            raise InputError(
                f"Legs {name}: expected shape (n, 6), position and velocity, got {np.shape(value)}"
            )
    elif array.ndim == 0:
        array = array.reshape(1)
    elif array.ndim != 1:
        raise InputError(f"Legs {name}: expected shape (n,), got {array.shape}")
    return array


def _common_length(arrays: dict[str, NDArray[Any]]) -> int:
    lengths = {name: len(array) for name, array in arrays.items() if len(array) != 1}
    n = next(iter(lengths.values()), 1)
    for name, length in lengths.items():
        if length != n:
            first = next(iter(lengths))
            raise InputError(
                f"Legs {name}: {length} rows, but {first} has {n}; expected the same or one"
            )
    return n


def _broadcast(name: str, array: NDArray[Any], n: int) -> NDArray[Any]:
    if len(array) not in (1, n):
        raise InputError(f"Legs {name}: {len(array)} rows, expected {n} or one")
    if len(array) != n:
        array = np.repeat(array, n, axis=0) if n else array[:0]
    array = np.ascontiguousarray(array)
    array.flags.writeable = False
    return array


# What a value beyond these limits usually is: (limit, unit that was probably meant).
_UPPER_LIMITS = {
    "tof_days": (_MAX_TOF_DAYS, "days", "seconds"),
    "thrust": (_MAX_THRUST_N, "N", "mN"),
    "isp": (_MAX_ISP_S, "s", "m/s, an exhaust velocity"),
    "m0": (_MAX_MASS_KG, "kg", "g"),
    "m_dry": (_MAX_MASS_KG, "kg", "g"),
}


def _check_scalar_column(label: str, column: NDArray[np.float64], name: str) -> None:
    check_finite(label, column)
    limit, unit, slip = _UPPER_LIMITS[name]
    not_positive = column < 0 if name == "m_dry" else column <= 0
    if not_positive.any():
        row = int(np.argmax(not_positive))
        floor = "zero or more" if name == "m_dry" else "more than zero"
        raise InputError(f"{label}, row {row}: {column[row]:g} {unit}, expected {floor}")
    too_large = column > limit
    if too_large.any():
        row = int(np.argmax(too_large))
        raise InputError(
            f"{label}, row {row}: {column[row]:g} {unit} is beyond {limit:g} {unit}; "
            f"is it in {slip}?"
        )
