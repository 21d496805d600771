"""Where scouts begin: in a part of the departure window, or near an itinerary that is known."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits import OrbitalNeighbours
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem

_SPREADS_DAYS: Final = (30.0, 60.0, 120.0, 250.0)
_NEAR: Final = (5, 10, 16)
"""Starts near an itinerary differ from it by up to this many days, and lie among this many nearest
bodies; one of each is drawn for a scout."""

_FIRST_BODIES: Final = 4
"""Starts lie near one of the first bodies of the itinerary."""

_NEIGHBOUR_SHARE: Final = 0.7
"""Share of the starts at neighbours of those bodies, the others being at themselves."""


def window_part(problem: Problem, part: int, parts: int) -> tuple[float, float]:
    """Return first and last epoch (MJD2000) of one of equal parts of the departure window."""
    first, last = problem.first_departure_mjd2000
    width = (last - first) / parts
    return first + part * width, first + (part + 1) * width


def starts_near(
    problem: Problem,
    neighbours: OrbitalNeighbours,
    itinerary: Nodes,
    count: int,
    rng: np.random.Generator,
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Draw starts near the beginning of an itinerary.

    A start of which the problem does not allow the body is moved to the itinerary's own.

    Parameters
    ----------
    problem : Problem
        Window and start bodies.
    neighbours : OrbitalNeighbours
        Which bodies are near.
    itinerary : Nodes
        One node, the end of the itinerary.
    count : int
        How many starts.
    rng : numpy.random.Generator
        Draws them.

    Returns
    -------
    rows : (count,) intp
        Catalogue rows.
    t_mjd2000 : (count,) float64
        Epochs, within the window.
    """
    spread = rng.choice(_SPREADS_DAYS)
    near = min(int(rng.choice(_NEAR)), len(problem.catalogue) - 1)
    known = min(_FIRST_BODIES, int(itinerary.depth[0]) + 1)
    epochs = itinerary.t_first_mjd2000[0] + rng.uniform(-spread, spread, count)
    epochs = np.clip(epochs, *problem.first_departure_mjd2000)
    body = itinerary.visited[0, rng.integers(0, known, count)]
    beside = neighbours.query(body, epochs, near)[np.arange(count), rng.integers(0, near, count)]
    rows = np.where(rng.random(count) < _NEIGHBOUR_SHARE, beside, body)
    allowed = np.isin(rows, problem.start_rows())
    return np.where(allowed, rows, itinerary.visited[0, 0]).astype(np.intp), epochs
