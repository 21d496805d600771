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


_MANY_QUERIES: Final = 5000
"""From so many on, queries go from leaf to leaf of a tree: memory is read in order, 4 times as
fast for 200 000 bodies."""

_SAMPLED: Final = 50
"""One body in so many tells how dense neighbourhoods are."""


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

    def densest(
        self, rows: ArrayLike, t_mjd2000: float, n_neighbours: int, count: int
    ) -> NDArray[np.int64]:
        """Return those of many bodies that are in the densest neighbourhoods.

        A search within a distance is several times as fast as one for the nearest. The distance
        is that within which some of the bodies have enough neighbours.

        Parameters
        ----------
        rows : array_like
            (k,) rows of the catalogue.
        t_mjd2000 : float
            Epoch, rounded to its bucket.
        n_neighbours : int
            How many neighbours make a neighbourhood, 1 to n - 1.
        count : int
            How many bodies are wanted.

        Returns
        -------
        NDArray
            Positions in `rows`, ascending, of at least `count` bodies (all, if there are no
            more): those whose n-th neighbour is nearest, at the epoch of the bucket.

        Raises
        ------
        InputError
            As `query`.
        """
        index, epochs = self._catalogue.checked_queries(rows, t_mjd2000)
        if count >= len(index):
            return np.arange(len(index))
        tree = self._tree(int(np.rint(epochs[0] / self._bucket_days)))
        order = np.argsort(_places(tree)[index], kind="stable")
        points = tree.data[index[order]]
        sample = np.sort(tree.query(points[::_SAMPLED], k=[n_neighbours + 1])[0][:, 0])
        place = count // _SAMPLED + 3
        while place < len(sample):
            within = tree.query(
                points, k=[n_neighbours + 1], distance_upper_bound=float(sample[place])
            )[0][:, 0]
            found = np.flatnonzero(np.isfinite(within))
            if len(found) >= count:
                return np.sort(order[found])
            place *= 2
        return np.arange(len(index))

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


def _places(tree: Any) -> NDArray[np.int64]:
    """Return (n,) where each body lies in the order of the leaves."""
    places = np.empty(tree.n, np.int64)
    places[tree.indices] = np.arange(tree.n)
    return places


def _others(tree: Any, rows: NDArray[np.int64], n_neighbours: int) -> NDArray[np.int64]:
    if len(rows) < _MANY_QUERIES:
        distance, found = tree.query(tree.data[rows], k=n_neighbours + 1)
    else:
        order = np.argsort(_places(tree)[rows], kind="stable")
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        distance, found = tree.query(tree.data[rows[order]], k=n_neighbours + 1)
        distance, found = distance[back], found[back]
    found = found.astype(np.int64)
    # A body among many coincident ones may be missing from its own answer: then the
    # farthest found is the one too many.
    is_self = found == rows[:, None]
    distance[is_self] = np.inf
    distance[~is_self.any(axis=1), -1] = np.inf
    order = np.lexsort((found, distance), axis=1)
    return np.take_along_axis(found, order, axis=1)[:, :n_neighbours]
