"""Start nodes: bodies and epochs with many near neighbours in the orbital metric."""

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits import OrbitalNeighbours, orbital_metric
from seqsearch.settings import SearchSettings
from seqsearch.tour_problem import TourProblem

_CROWD = 8
"""Neighbours that count: the distance to the eighth says how dense a neighbourhood is."""


def dense_starts(
    problem: TourProblem,
    neighbours: OrbitalNeighbours,
    settings: SearchSettings,
    rng: np.random.Generator,
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Choose the asteroid-epoch pairs from which tours start.

    Epochs are drawn one from each of ``settings.start_epochs`` equal slices of
    the departure window (stratified, so that passes with other seeds see other
    epochs). At each, every allowed body's distance to its eighth nearest
    neighbour in the orbital metric is found; the pairs with the smallest win,
    each body at most once.

    Returns
    -------
    rows : (n,) intp
        Catalogue rows, n at most ``settings.starts``.
    t_mjd2000 : (n,) float64
        Start epochs.
    """
    earliest, latest = problem.first_departure_mjd2000
    slices = (np.arange(settings.start_epochs) + rng.random(settings.start_epochs)) / (
        settings.start_epochs
    )
    epochs = earliest + slices * (latest - earliest)
    allowed = problem.start_rows()
    crowd = min(_CROWD, len(problem.catalogue) - 1)
    rows, times, distances = [], [], []
    for epoch in epochs:
        near = neighbours.query(allowed, np.full(len(allowed), epoch), crowd)
        points = orbital_metric(problem.catalogue.states(epoch), settings.reference_tof_days)
        distance = np.linalg.norm(points[near[:, -1]] - points[allowed], axis=1)
        best = np.argsort(distance, kind="stable")[: 4 * settings.starts]
        rows.append(allowed[best])
        times.append(np.full(len(best), epoch))
        distances.append(distance[best])
    row = np.concatenate(rows)
    order = np.argsort(np.concatenate(distances), kind="stable")
    _, first = np.unique(row[order], return_index=True)
    chosen = order[np.sort(first)[: settings.starts]]
    return row[chosen], np.concatenate(times)[chosen]
