"""Start nodes: bodies and epochs from which many other bodies can be reached."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from feasibility.orbits import OrbitalNeighbours, orbital_metric
from feasibility.runtime.workers import in_threads
from seqsearch.core.hop_margins import log_margin, quick_margin_of
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings

_Rows = NDArray[np.intp]
_Array = NDArray[np.float64]

_CROWD: Final = 8
"""Neighbours that count: the distance to the eighth says how dense a neighbourhood is."""

_SCREEN_NEAR: Final = 30
_SCREEN_TIMES: Final = (0.5, 0.75, 1.0)
"""The screen asks for this many nearest bodies, at these shares of the reference flight time."""

_SOFT: Final = 0.3
"""A target whose log(m*/m0) is this much below 0 counts nothing, one at 0 or more counts 1."""

_PAIRS_AT_ONCE: Final = 300

_MANY_BODIES: Final = 100_000
"""From so many on, crowds are measured only where neighbourhoods are dense, and each epoch looks
at bodies of its own; no published competition has as many."""
_BODIES_AN_EPOCH: Final = 25_000
"""How many bodies an epoch looks at then, among them every k-th: epochs take turns."""
_SPARE: Final = 4
"""How many times as many bodies are measured as are wanted: between the epoch in question and that
of the neighbours' bucket, distances change by some per cent."""

Starts = Callable[[SearchSettings, np.random.Generator], Nodes]
"""Chooses the start nodes of a pass."""


def make_starts(
    problem: Problem,
    neighbours: OrbitalNeighbours,
    predictor: LegPredictor | None,
    threads: int,
) -> Starts:
    """Return what chooses starts: the problem itself, or else what is known of legs from there."""
    if problem.custom_moves is not None:
        return problem.custom_moves.starts
    if predictor is None:
        return lambda settings, rng: problem.start_nodes(
            *dense_starts(problem, neighbours, settings, rng)
        )
    return lambda settings, rng: problem.start_nodes(
        *reachable_starts(problem, neighbours, predictor, settings, rng, threads)
    )


def dense_starts(
    problem: Problem,
    neighbours: OrbitalNeighbours,
    settings: SearchSettings,
    rng: np.random.Generator,
    window: tuple[float, float] | None = None,
) -> tuple[_Rows, _Array]:
    """Choose the asteroid-epoch pairs from which tours start, by the orbital metric.

    Epochs are drawn one from each of ``settings.start_epochs`` equal slices of
    the departure window (stratified, so that passes with other seeds see other
    epochs). At each, every allowed body's distance to its eighth nearest
    neighbour in the orbital metric is found; the pairs with the smallest win,
    each body at most once, or where it is alone as often as there are epochs. `window` replaces
    the problem's earliest and latest start epoch.

    Returns
    -------
    rows : (n,) intp
        Catalogue rows, n at most ``settings.starts``.
    t_mjd2000 : (n,) float64
        Start epochs.
    """
    rows, epochs, distances = _crowded(
        problem, neighbours, settings, rng, 4 * settings.starts, window
    )
    chosen = _best_of_each_body(rows, distances, settings.starts)
    return rows[chosen], epochs[chosen]


def reachable_starts(
    problem: Problem,
    neighbours: OrbitalNeighbours,
    predictor: LegPredictor,
    settings: SearchSettings,
    rng: np.random.Generator,
    threads: int = 1,
) -> tuple[_Rows, _Array]:
    """Choose the asteroid-epoch pairs from which tours start, by what can be reached.

    The most crowded pairs, as `dense_starts` has them, are screened: the
    predictor is asked about legs to their 30 nearest bodies at three flight
    times, about ``settings.screen_legs`` legs in all, with half of the
    propellant used up, as on the middle of a tour. The pairs with the most
    targets win, quick ones counting up to three times, each body at most once.

    Parameters
    ----------
    problem, neighbours, settings, rng
        As for `dense_starts`.
    predictor : LegPredictor
        Answers the questions; quick answers will do.
    threads : int
        How many questions are worked on at once; the answer does not depend on it.

    Returns
    -------
    rows : (n,) intp
        Catalogue rows, n at most ``settings.starts``.
    t_mjd2000 : (n,) float64
        Start epochs.
    """
    near = min(_SCREEN_NEAR, len(problem.catalogue) - 1)
    legs_per_pair = near * len(_SCREEN_TIMES)
    n_pairs = max(settings.starts, settings.screen_legs // legs_per_pair)
    per_epoch = -(-n_pairs // settings.start_epochs)
    rows, epochs, _ = _crowded(problem, neighbours, settings, rng, per_epoch)
    times = np.multiply(_SCREEN_TIMES, settings.reference_tof_days)
    targets = neighbours.query(rows, epochs, near)
    ask = quick_margin_of(predictor)

    def count(block: _Rows) -> _Array:
        nodes = problem.start_nodes(rows[block], epochs[block])
        middle = np.full(len(block), 0.5 * (problem.m0 + problem.spacecraft.m_dry))
        shape = (len(block), near, len(times))
        parent, target, tof = (
            np.broadcast_to(column, shape).ravel()
            for column in (
                np.arange(len(block))[:, None, None],
                targets[block][:, :, None],
                times,
            )
        )
        hops = problem.hops(
            replace(nodes, mass=middle), parent, target, epochs[block][parent], tof
        )
        answers = np.nan_to_num(log_margin(ask, hops), nan=-np.inf)
        counts: _Array = np.clip(1.0 + answers / _SOFT, 0.0, 1.0).reshape(shape).sum(axis=(1, 2))
        return counts

    blocks = (
        np.arange(first, min(first + _PAIRS_AT_ONCE, len(rows)))
        for first in range(0, len(rows), _PAIRS_AT_ONCE)
    )
    counts = np.concatenate(list(in_threads(count, blocks, threads)))
    chosen = _best_of_each_body(rows, -counts, settings.starts)
    return rows[chosen], epochs[chosen]


def _crowded(
    problem: Problem,
    neighbours: OrbitalNeighbours,
    settings: SearchSettings,
    rng: np.random.Generator,
    per_epoch: int,
    window: tuple[float, float] | None = None,
) -> tuple[_Rows, _Array, _Array]:
    """Return rows, epochs and distances to the eighth neighbour of the densest at each epoch."""
    earliest, latest = window or problem.first_departure_mjd2000
    slices = (np.arange(settings.start_epochs) + rng.random(settings.start_epochs)) / (
        settings.start_epochs
    )
    allowed = problem.start_rows()
    crowd = min(_CROWD, len(problem.catalogue) - 1)
    rows, times, distances = [], [], []
    for turn, epoch in enumerate(earliest + slices * (latest - earliest)):
        here = allowed
        if len(allowed) >= _MANY_BODIES:
            step = len(allowed) // _BODIES_AN_EPOCH
            here = allowed[turn % step :: step]
            here = here[neighbours.densest(here, epoch, crowd, _SPARE * per_epoch)]
        near = neighbours.query(here, np.full(len(here), epoch), crowd)
        points = orbital_metric(problem.catalogue.states(epoch), settings.reference_tof_days)
        distance = np.linalg.norm(points[near[:, -1]] - points[here], axis=1)
        best = np.argsort(distance, kind="stable")[:per_epoch]
        rows.append(here[best])
        times.append(np.full(len(best), epoch))
        distances.append(distance[best])
    return np.concatenate(rows), np.concatenate(times), np.concatenate(distances)


def _best_of_each_body(rows: _Rows, cost: _Array, count: int) -> _Rows:
    """Return the positions of the pairs with the least cost, one of each body, best first.

    A body that is alone may be there as often as it is among the pairs.
    """
    order = np.argsort(cost, kind="stable")
    if len(rows) and (rows == rows[0]).all():
        return order[:count]
    _, first = np.unique(rows[order], return_index=True)
    chosen: _Rows = order[np.sort(first)[:count]]
    return chosen
