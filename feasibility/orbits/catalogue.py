"""`Catalogue`: many bodies, and where they are at any epoch: on Kepler orbits, or as told."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, Final, Self, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import DAY_S, MU_SUN
from feasibility.errors import InputError
from feasibility.orbits.classical import cartesian_to_classical, perifocal_axes
from feasibility.orbits.spk.kernel_table import KernelTable
from feasibility.quantities import plain_numbers
from feasibility.runtime.text_column import TextColumn, taken_texts

_ELEMENT_UNITS: Final = ("m", "", "rad", "rad", "rad", "rad")


@final
@dataclass(frozen=True, eq=False, repr=False)
class Catalogue:
    """Bodies in heliocentric motion, one row a body.

    An `feasibility.orbits.spk.Ephemeris` of two-body motion, unless another one is given.

    With n the number of bodies. Arrays are copied once, validated once and
    made read-only. Quantities with units (astropy, pint) are converted; elements, which have
    several units, as rows of single quantities.

    Parameters
    ----------
    ids : array_like
        (n,) int64, all different.
    names : sequence of str
        n names, for people; they need not differ. Kept as a tuple, or as the `TextColumn` that
        was given.
    epoch_mjd2000 : array_like
        (n,) float64, or one value for all: epoch of the elements.
    elements : array_like
        (n, 6) float64: a [m], e, i, node, argp, mean anomaly [rad], osculating
        at the epoch, heliocentric J2000 ecliptic.
    source : str
        Where the bodies come from: a file name, or how they were made.
    extra : mapping of str to array_like, optional
        (n,) float64 each: further numeric columns of the table by name, in its units; values
        may be NaN. Motion does not depend on them.
    ephemeris : KernelTable, optional
        How the bodies move instead of by their elements, which then osculate.

    Raises
    ------
    InputError
        A shape does not fit, a unit cannot be converted, an epoch or element is not finite,
        an orbit is not an ellipse (a <= 0 or e outside [0, 1)), or an id occurs twice. The
        message names the first bad row.

    Examples
    --------
    >>> from feasibility.orbits import earth
    >>> r = earth().states(0.0)[0, :3]
    >>> bool(1.4e11 < (r @ r) ** 0.5 < 1.6e11)
    True
    """

    ids: NDArray[np.int64]
    names: Sequence[str]
    epoch_mjd2000: NDArray[np.float64]
    elements: NDArray[np.float64]
    source: str
    extra: Mapping[str, NDArray[np.float64]]
    ephemeris: KernelTable | None

    def __init__(
        self,
        ids: ArrayLike,
        names: Sequence[str],
        epoch_mjd2000: ArrayLike,
        elements: ArrayLike,
        source: str,
        extra: Mapping[str, ArrayLike] | None = None,
        ephemeris: KernelTable | None = None,
    ) -> None:
        id_column = _integers("Catalogue ids", ids)
        element_rows = _numbers("Catalogue elements", elements, _ELEMENT_UNITS)
        n = len(id_column)
        if n == 0:
            element_rows = element_rows.reshape(0, 6)
        if element_rows.shape != (n, 6):
            raise InputError(
                f"Catalogue elements: expected shape ({n}, 6), one row an id, "
                f"got {element_rows.shape}"
            )
        if len(names) != n:
            raise InputError(f"Catalogue names: {len(names)} names, expected {n}, one an id")
        epochs = _numbers("Catalogue epoch_mjd2000", epoch_mjd2000, ("day",))
        if epochs.shape not in ((), (1,), (n,)):
            raise InputError(
                f"Catalogue epoch_mjd2000: expected shape ({n},) or one value, got {epochs.shape}"
            )
        epochs = np.broadcast_to(epochs, (n,)).copy()
        if ephemeris is not None and len(ephemeris) != n:
            raise InputError(f"Catalogue ephemeris: has {len(ephemeris)} bodies, expected {n}")
        _check_orbits(epochs, element_rows)
        _check_distinct(id_column)
        columns = {name: _extra_column(name, column, n) for name, column in (extra or {}).items()}
        for array in (id_column, epochs, element_rows, *columns.values()):
            array.flags.writeable = False
        object.__setattr__(self, "ids", id_column)
        texts = names if isinstance(names, TextColumn) else tuple(str(name) for name in names)
        object.__setattr__(self, "names", texts)
        object.__setattr__(self, "epoch_mjd2000", epochs)
        object.__setattr__(self, "elements", element_rows)
        object.__setattr__(self, "source", source)
        object.__setattr__(self, "extra", MappingProxyType(columns))
        object.__setattr__(self, "ephemeris", ephemeris)

    @classmethod
    def from_states(
        cls,
        ids: ArrayLike,
        names: Sequence[str],
        t_mjd2000: ArrayLike,
        states: ArrayLike,
        source: str = "states",
    ) -> Self:
        """Return the bodies that pass through states, on the Kepler orbits that follow from them.

        Parameters
        ----------
        ids, names, source
            As for the class.
        t_mjd2000 : array_like
            (n,) epochs of the states, or one for all.
        states : array_like
            (n, 6), m and m/s.

        Raises
        ------
        InputError
            As the class; a state is not on an ellipse about the Sun.
        """
        return cls(ids, names, t_mjd2000, cartesian_to_classical(states), source)

    def __len__(self) -> int:
        return len(self.ids)

    def __repr__(self) -> str:
        return f"Catalogue(n={len(self)}, source={self.source!r})"

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what can be derived: catalogues travel to worker processes."""
        fields = self.__dataclass_fields__
        state = {name: value for name, value in self.__dict__.items() if name in fields}
        # A read-only view cannot be pickled.
        return {**state, "extra": dict(self.extra)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take the fields over, and make what came as copies read-only again."""
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)
        for column in self.extra.values():
            column.flags.writeable = False
        object.__setattr__(self, "extra", MappingProxyType(self.extra))

    @property
    def period_days(self) -> NDArray[np.float64]:
        """(n,) orbital period in days."""
        result: NDArray[np.float64] = 2.0 * np.pi / self._mean_motion / DAY_S
        return result

    def rows_of(self, ids: ArrayLike) -> NDArray[np.int64]:
        """Return the rows of the given ids.

        Parameters
        ----------
        ids : array_like
            (k,) integers, or one.

        Returns
        -------
        NDArray
            (k,) int64.

        Raises
        ------
        InputError
            An id is not in the catalogue.
        """
        wanted = _integers("ids", ids)
        order, ordered = self._id_index
        place = np.searchsorted(ordered, wanted)
        known = place < len(ordered)
        known[known] = ordered[place[known]] == wanted[known]
        if not known.all():
            stranger = wanted[int(np.argmin(known))]
            raise InputError(f"id {stranger} is not in {self.source} ({len(self)} bodies)")
        return order[place]

    def states(self, t_mjd2000: float) -> NDArray[np.float64]:
        """Return the states of all bodies at one epoch.

        Parameters
        ----------
        t_mjd2000 : float
            Epoch.

        Returns
        -------
        NDArray
            (n, 6) float64, m and m/s.

        Raises
        ------
        InputError
            The epoch is not one finite number.
        """
        if np.ndim(t_mjd2000) != 0:
            raise InputError(
                f"epoch: expected one number, got shape {np.shape(t_mjd2000)}; "
                "states_at takes one epoch a body"
            )
        return self.states_at(np.arange(len(self)), t_mjd2000)

    def states_at(self, rows: ArrayLike, t_mjd2000: ArrayLike) -> NDArray[np.float64]:
        """Return the states of chosen bodies, each at its own epoch.

        Parameters
        ----------
        rows : array_like
            (k,) rows of the catalogue, 0 to n - 1, repeats allowed.
        t_mjd2000 : array_like
            (k,) epochs, or one for all.

        Returns
        -------
        NDArray
            (k, 6) float64, m and m/s.

        Raises
        ------
        InputError
            A row is out of range, the shapes do not fit, or an epoch is not finite.
        """
        # numba takes a third of a second to import: pay when the first state is asked for.
        from feasibility.orbits.catalogue_kernels import propagate_rows

        index, epochs = self.checked_queries(rows, t_mjd2000)
        if self.ephemeris is not None:
            return self.ephemeris.states_at(index, epochs)
        states: NDArray[np.float64] = propagate_rows(self._orbits, index, epochs)
        return states

    def checked_queries(
        self, rows: ArrayLike, t_mjd2000: ArrayLike
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Validate pairs of row and epoch once, and broadcast one epoch to all rows.

        Returns
        -------
        tuple of NDArray
            (k,) int64 rows and (k,) float64 epochs in MJD2000.

        Raises
        ------
        InputError
            A row is out of range, the shapes do not fit, or an epoch is not finite.
        """
        index = self._checked_rows(rows)
        epochs = np.asarray(t_mjd2000, dtype=np.float64)
        if epochs.shape not in ((), (1,), index.shape):
            raise InputError(
                f"epochs: expected shape ({len(index)},) or one value, got {epochs.shape}"
            )
        if not np.isfinite(epochs).all():
            raise InputError("epochs: expected finite numbers, got a NaN or an infinity")
        return index, np.ascontiguousarray(np.broadcast_to(epochs, index.shape))

    def select(self, rows: ArrayLike) -> "Catalogue":
        """Return a catalogue of the given rows (indices or a boolean mask), in that order.

        Raises
        ------
        InputError
            A row is out of range or given twice, or the mask has another length.
        """
        mask = np.asarray(rows)
        if mask.dtype == bool:
            if mask.shape != (len(self),):
                raise InputError(f"mask: expected shape ({len(self)},), got {mask.shape}")
            rows = np.flatnonzero(mask)
        index = self._checked_rows(rows)
        return Catalogue(
            ids=self.ids[index],
            names=taken_texts(self.names, index),
            epoch_mjd2000=self.epoch_mjd2000[index],
            elements=self.elements[index],
            source=self.source,
            extra={name: column[index] for name, column in self.extra.items()},
            ephemeris=None if self.ephemeris is None else self.ephemeris.select(index),
        )

    def with_bodies(self, more: "Catalogue") -> "Catalogue":
        """Return the catalogue with the bodies of another one after its own.

        Columns that one of the two lacks have no value there; the source stays.

        Raises
        ------
        InputError
            An id is in both, or one of them moves by kernels.
        """
        if self.ephemeris is not None or more.ephemeris is not None:
            raise InputError(
                f"{self.source} and {more.source}: bodies that move by SPK kernels, expected "
                'Kepler orbits where bodies are added (ephemeris = "kepler")'
            )
        both = np.intersect1d(self.ids, more.ids)
        if len(both):
            raise InputError(
                f"{more.source}: id {both[0]} is in {self.source} too, expected another one"
            )
        parts = (self, more)
        columns = {name: None for part in parts for name in part.extra}
        return Catalogue(
            ids=np.concatenate([part.ids for part in parts]),
            names=[*self.names, *more.names],
            epoch_mjd2000=np.concatenate([part.epoch_mjd2000 for part in parts]),
            elements=np.concatenate([part.elements for part in parts]),
            source=self.source,
            extra={
                name: np.concatenate(
                    [part.extra.get(name, np.full(len(part), np.nan)) for part in parts]
                )
                for name in columns
            },
        )

    def _checked_rows(self, rows: ArrayLike) -> NDArray[np.int64]:
        index = _integers("rows", rows)
        if len(index) and not (index.min() >= 0 and index.max() < len(self)):
            bad = index[(index < 0) | (index >= len(self))][0]
            raise InputError(f"row {bad} is not in {self.source}: expected 0 to {len(self) - 1}")
        return index

    @cached_property
    def _mean_motion(self) -> NDArray[np.float64]:
        """(n,) rad/s, Kepler's third law with the Sun's mu."""
        a = self.elements[:, 0]
        result: NDArray[np.float64] = np.sqrt(MU_SUN / a) / a
        return result

    @cached_property
    def _id_index(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        order = np.argsort(self.ids, kind="stable").astype(np.int64)
        return order, self.ids[order]

    @cached_property
    def _orbits(self) -> NDArray[np.float64]:
        """(n, 10), packed for the kernel."""
        from feasibility.orbits import catalogue_kernels as columns

        along, across = perifocal_axes(self.elements)
        packed = np.empty((len(self), columns.N_COLUMNS))
        packed[:, columns.ECCENTRICITY] = self.elements[:, 1]
        packed[:, columns.MEAN_ANOMALY] = self.elements[:, 5]
        packed[:, columns.MEAN_MOTION] = self._mean_motion
        packed[:, columns.EPOCH] = self.epoch_mjd2000
        packed[:, columns.AXIS_A : columns.AXIS_A + 3] = along
        packed[:, columns.AXIS_B : columns.AXIS_B + 3] = across
        return packed


def _numbers(label: str, values: ArrayLike, units: tuple[str, ...]) -> NDArray[np.float64]:
    """Return a copy as float64, of quantities with units in the given ones."""
    try:
        return np.array(plain_numbers(label, values, units), dtype=np.float64)
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{label}: expected numbers ({error})") from None


def _integers(what: str, values: ArrayLike) -> NDArray[np.int64]:
    array = np.atleast_1d(np.asarray(values))
    if array.size == 0:
        array = array.astype(np.int64)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise InputError(
            f"{what}: expected integers of shape (k,), got {array.dtype} of shape {array.shape}"
        )
    return np.array(array, dtype=np.int64)


def _extra_column(name: str, values: ArrayLike, n: int) -> NDArray[np.float64]:
    try:
        plain = plain_numbers(f"Catalogue extra {name!r}", values, ())
        column = np.array(plain, dtype=np.float64)
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"Catalogue extra {name!r}: expected numbers") from None
    if column.shape != (n,):
        raise InputError(
            f"Catalogue extra {name!r}: expected shape ({n},), one value an id, got {column.shape}"
        )
    return column


def _check_distinct(ids: NDArray[np.int64]) -> None:
    values, counts = np.unique(ids, return_counts=True)
    if (counts > 1).any():
        twice = values[int(np.argmax(counts > 1))]
        raise InputError(f"Catalogue ids: {twice} occurs more than once")


def _check_orbits(epochs: NDArray[np.float64], elements: NDArray[np.float64]) -> None:
    finite = np.isfinite(elements).all(axis=1) & np.isfinite(epochs)
    if not finite.all():
        row = int(np.argmin(finite))
        raise InputError(f"Catalogue, row {row}: an element or the epoch is not finite")
    a, e = elements[:, 0], elements[:, 1]
    bound = (a > 0) & (e >= 0) & (e < 1)
    if not bound.all():
        row = int(np.argmin(bound))
        raise InputError(
            f"Catalogue, row {row}: a = {a[row]:g} m, e = {e[row]:g} is not an ellipse; "
            "expected a > 0 and 0 <= e < 1"
        )
