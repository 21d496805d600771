"""Chebyshev polynomials that follow a motion: as many pieces as an error bound asks for."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S

_Array = NDArray[np.float64]

N_COEFFICIENTS: Final = 12

_POSITION_M: Final = 0.05
_VELOCITY_M_S: Final = 1e-5
"""Errors at which a piece is good enough. Rounding of epochs alone makes 5 mm."""

_LONGEST_S: Final = 32 * DAY_S
_SHORTEST_S: Final = 600.0
"""Pieces of a motion with jumps are not halved for ever."""

_NODES: Final = np.cos(np.pi * (np.arange(N_COEFFICIENTS) + 0.5) / N_COEFFICIENTS)
_AT_NODES: Final = np.polynomial.chebyshev.chebvander(_NODES, N_COEFFICIENTS - 1)
_CHECKS: Final = np.linspace(-1.0, 1.0, 10)
_AT_CHECKS: Final = np.polynomial.chebyshev.chebvander(_CHECKS, N_COEFFICIENTS - 1)


@final
@dataclass(frozen=True, eq=False)
class Fit:
    """Pieces one after another.

    Attributes
    ----------
    start, end : (p,) float64
        Seconds of TDB past J2000.
    coefficients : (p, 6, N_COEFFICIENTS) float64
        Of positions and velocities, m and m/s.
    worst_m : float
        Largest error in position that was seen, between the nodes.
    """

    start: _Array
    end: _Array
    coefficients: _Array
    worst_m: float


def fit(states: Callable[[_Array], _Array], start: float, end: float) -> Fit:
    """Return polynomials that follow a motion from start to end.

    Positions and velocities have polynomials of their own: a kernel's velocities need not be the
    derivatives of its positions. Pieces are halved until they err by less than 5 cm and
    0.01 mm/s at ten points, or are ten minutes long.

    Parameters
    ----------
    states : callable
        (k,) seconds to (k, 6) states, m and m/s.
    start, end : float
        Seconds of TDB past J2000.
    """
    count = max(1, int(np.ceil((end - start) / _LONGEST_S)))
    edges = np.linspace(start, end, count + 1)
    todo = np.column_stack([edges[:-1], edges[1:]])
    done: list[tuple[_Array, _Array]] = []
    worst_m = 0.0
    while len(todo):
        coefficients = _interpolated(states, todo)
        position, velocity = _errors(states, todo, coefficients)
        good = (position <= _POSITION_M) & (velocity <= _VELOCITY_M_S)
        good |= todo[:, 1] - todo[:, 0] <= _SHORTEST_S
        done.append((todo[good], coefficients[good]))
        worst_m = max(worst_m, float(position[good].max(initial=0.0)))
        middle = todo[~good].mean(axis=1)
        todo = np.concatenate(
            [
                np.column_stack([todo[~good, 0], middle]),
                np.column_stack([middle, todo[~good, 1]]),
            ]
        )
    spans = np.concatenate([span for span, _ in done])
    order = np.argsort(spans[:, 0], kind="stable")
    pieces = np.concatenate([piece for _, piece in done])
    return Fit(spans[order, 0], spans[order, 1], pieces[order], worst_m)


def _sampled(states: Callable[[_Array], _Array], spans: _Array, points: _Array) -> _Array:
    """Return (m, points, 6) states at the same points of every span."""
    half = (spans[:, 1] - spans[:, 0]) / 2.0
    epochs = spans.mean(axis=1)[:, None] + half[:, None] * points
    found = states(np.clip(epochs, spans[:, :1], spans[:, 1:]).ravel())
    return found.reshape(len(spans), len(points), 6)


def _interpolated(states: Callable[[_Array], _Array], spans: _Array) -> _Array:
    values = _sampled(states, spans, _NODES)
    # The polynomials are orthogonal over their nodes.
    weights = np.full(N_COEFFICIENTS, 2.0 / N_COEFFICIENTS)
    weights[0] /= 2.0
    result: _Array = np.einsum("nk,mnc->mck", _AT_NODES * weights, values)
    return result


def _errors(
    states: Callable[[_Array], _Array], spans: _Array, coefficients: _Array
) -> tuple[_Array, _Array]:
    found = np.einsum("nk,mck->mnc", _AT_CHECKS, coefficients)
    error = found - _sampled(states, spans, _CHECKS)
    position = np.linalg.norm(error[:, :, :3], axis=2).max(axis=1)
    velocity = np.linalg.norm(error[:, :, 3:], axis=2).max(axis=1)
    return position, velocity
