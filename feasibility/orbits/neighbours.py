"""Nearest neighbours of bodies in the orbital metric: the moves a search proposes."""

from collections import OrderedDict
from typing import Any, Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from feasibility.constants import DAY_S
from feasibility.errors import InputError
from feasibility.orbits.catalogue import Catalogue

_MAX_POINTS: Final = 5_000_000
"""Points in all trees that are kept at a time: 400 MB, 5 years of 30-day buckets for 83 000
bodies, 25 years for 16 000."""


def orbital_metric(states: ArrayLike, reference_tof_days: float) -> NDArray[np.float64]:
    """Map states to points whose Euclidean distance is the orbital metric.

    The point of a state (r, v) is (r/T + v, r/T). The two halves of a
    difference are, in linear approximation without gravity, the velocity
    changes at departure and arrival of a transfer of duration T (Hennes, Izzo,
    Landau, "Fast approximators for optimal low-thrust hops between main belt
    asteroids", IEEE SSCI 2016; `pykep.utils.knn`).

    Parameters
    ----------
    states : array_like
        (n, 6), m and m/s.
    reference_tof_days : float
        The duration T in days.

    Returns
    -------
    NDArray
        (n, 6) float64, m/s.
    """
    rv = np.asarray(states, dtype=np.float64)
    drift = rv[:, :3] / (reference_tof_days * DAY_S)
    return np.concatenate([drift + rv[:, 3:], drift], axis=1)


@final
class OrbitalNeighbours:
    """Nearest neighbours over a whole catalogue at any epoch.

    Epochs are rounded to the nearest multiple of `bucket_days`; one KD-tree of
    all bodies is built for each bucket when it is first asked for, and reused.

    Parameters
    ----------
    catalogue : Catalogue
        The bodies, at least two.
    reference_tof_days : float
        Duration T of the metric in days, see `orbital_metric`.
    bucket_days : float
        Width of an epoch bucket in days.

    Raises
    ------
    InputError
        Fewer than two bodies, or a parameter that is not finite and positive.
    """

    def __init__(
        self,
        catalogue: Catalogue,
        reference_tof_days: float = 180.0,
        bucket_days: float = 30.0,
    ) -> None:
        if len(catalogue) < 2:
            raise InputError(
                f"neighbours in {catalogue.source}: expected two bodies or more, "
                f"got {len(catalogue)}"
            )
        for name, value in (
            ("reference_tof_days", reference_tof_days),
            ("bucket_days", bucket_days),
        ):
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"neighbours {name}: {value} days, expected more than zero")
        self._catalogue = catalogue
        self._reference_tof_days = float(reference_tof_days)
        self._bucket_days = float(bucket_days)
        self._trees: OrderedDict[int, Any] = OrderedDict()

    def __getstate__(self) -> dict[str, Any]:
        """Leave the trees behind: building one is cheaper than sending it."""
        return {**self.__dict__, "_trees": OrderedDict()}

    def query(self, rows: ArrayLike, t_mjd2000: ArrayLike, n_neighbours: int) -> NDArray[np.int64]:
        """Return the nearest neighbours of bodies, each at its own epoch.

        Parameters
        ----------
        rows : array_like
            (k,) rows of the catalogue.
        t_mjd2000 : array_like
            (k,) epochs, or one for all; each is rounded to its bucket.
        n_neighbours : int
            How many neighbours, 1 to n - 1.

        Returns
        -------
        NDArray
            (k, n_neighbours) int64 rows of the catalogue, nearest first (the
            lower row first at equal distance), the body itself left out.

        Raises
        ------
        InputError
            A row is out of range, an epoch is not finite, the shapes do not
            fit, or `n_neighbours` is not in 1 to n - 1.
        """
        index, epochs = self._catalogue.checked_queries(rows, t_mjd2000)
        n = len(self._catalogue)
        if not 1 <= n_neighbours < n:
            raise InputError(f"n_neighbours: {n_neighbours}, expected 1 to {n - 1} for {n} bodies")
        buckets = np.rint(epochs / self._bucket_days)
        result = np.empty((len(index), n_neighbours), dtype=np.int64)
        for bucket in np.unique(buckets):
            members = np.flatnonzero(buckets == bucket)
            tree = self._tree(int(bucket))
            result[members] = _others(tree, index[members], n_neighbours)
        return result

    def _tree(self, bucket: int) -> Any:
        tree = self._trees.get(bucket)
        if tree is None:
            states = self._catalogue.states(bucket * self._bucket_days)
            tree = cKDTree(orbital_metric(states, self._reference_tof_days))
            self._trees[bucket] = tree
            if len(self._trees) * len(self._catalogue) > _MAX_POINTS:
                self._trees.popitem(last=False)
        else:
            self._trees.move_to_end(bucket)
        return tree


def _others(tree: Any, rows: NDArray[np.int64], n_neighbours: int) -> NDArray[np.int64]:
    distance, found = tree.query(tree.data[rows], k=n_neighbours + 1)
    found = found.astype(np.int64)
    # A body among many coincident ones may be missing from its own answer: then the
    # farthest found is the one too many.
    is_self = found == rows[:, None]
    distance[is_self] = np.inf
    distance[~is_self.any(axis=1), -1] = np.inf
    order = np.lexsort((found, distance), axis=1)
    return np.take_along_axis(found, order, axis=1)[:, :n_neighbours]
