"""The two optimisation problems of the reference solver, as pygmo problems over pykep's leg.

Decision vector: the throttles (3 s numbers), the excess velocity of each free end (3 numbers),
the initial mass (only where it is free) and the final mass. Constraints: 7 mismatches are zero, s
throttles have a norm of at most 1, and excess velocities one of at most their bound. The
gradients are exact, from pykep's leg.
"""

from collections.abc import Sequence
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

# The lower bound matters: the backward half divides by the mass after the impulse, so the model
# has legs that end with next to no mass and accelerate without limit. At 1e-5 that loophole
# doubled some m*; bounds that close it altogether left other legs of little final mass unsolved.
_MASS_BOUNDS: Final = (1e-3, 1e3)
_LEAST_THROTTLE: Final = 1e-10
_LEAST_SHARE: Final = 0.05
"""Of the initial mass, for legs with free ends: a spacecraft that ends with next to nothing could
pass an arrival body at any speed, and the loophole of above would be the rule."""
_ANY_SPEED: Final = 10.0
"""Bound of excess velocities that have none, in units of the Earth's."""


class _Cache:
    """Remembers the last point: pygmo asks for it again for objective and constraints."""

    def __init__(self) -> None:
        self._point = b""
        self._value: Any = None

    def get(self, point: bytes) -> Any:
        return self._value if point == self._point else None

    def put(self, point: bytes, value: Any) -> Any:
        self._point, self._value = point, value
        return value


class _LegProblem:
    """What the two problems share: constraints, bounds, sparsity and the caches."""

    n_masses: int

    def __init__(self, leg: Any, dep: float = 0.0, arr: float = 0.0) -> None:
        self.leg = leg
        self.n_segments: int = leg.nseg
        self._ends = [
            (name, np.array(getattr(leg, name)), bound)
            for name, bound in (("rvs", dep), ("rvf", arr))
            if bound > 0.0
        ]
        self._bounded = [k for k, (_, _, bound) in enumerate(self._ends) if bound < _ANY_SPEED]
        self._fitness = _Cache()
        self._gradient = _Cache()

    def get_nec(self) -> int:
        """Return the number of equality constraints."""
        return 7

    def get_nic(self) -> int:
        """Return the number of inequality constraints."""
        return self.n_segments + len(self._bounded) + self._n_shares

    @property
    def _n_shares(self) -> int:
        """Constraints on the final mass as a share of the initial one."""
        return 1 if self._ends and self.n_masses == 2 else 0

    def decision(
        self,
        throttles: Vector,
        dep_excess: Vector,
        arr_excess: Vector,
        masses: Sequence[float],
    ) -> Vector:
        """Return the decision vector of throttles (3 s,), excess velocities (3,) and masses."""
        given = {"rvs": dep_excess, "rvf": arr_excess}
        return np.concatenate([throttles, *(given[name] for name, _, _ in self._ends), masses])

    def throttles(self, x: Vector) -> Vector:
        """Return the throttles (3 s,) of a decision vector."""
        return x[: 3 * self.n_segments]

    def excess(self, x: Vector) -> tuple[Vector, Vector]:
        """Return the excess velocities (3,) of a decision vector, cut to their bounds."""
        found = {"rvs": np.zeros(3), "rvf": np.zeros(3)}
        for k, (name, _, bound) in enumerate(self._ends):
            excess = self._end(x, k)
            found[name] = excess * min(1.0, bound / max(float(np.linalg.norm(excess)), 1e-300))
        return found["rvs"], found["rvf"]

    def _end(self, x: Vector, k: int) -> Vector:
        first = 3 * (self.n_segments + k)
        return x[first : first + 3]

    def get_bounds(self) -> tuple[list[float], list[float]]:
        """Return lower and upper bounds of the decision vector."""
        n_throttles = 3 * self.n_segments
        lower, upper = _MASS_BOUNDS
        excess = [min(bound, _ANY_SPEED) for _, _, bound in self._ends for _ in range(3)]
        return (
            [-1.0] * n_throttles + [-bound for bound in excess] + [lower] * self.n_masses,
            [1.0] * n_throttles + excess + [upper] * self.n_masses,
        )

    def fitness(self, x: Vector) -> list[float]:
        """Return objective, mismatches and throttle constraints."""
        point = x.tobytes()
        known: list[float] | None = self._fitness.get(point)
        if known is not None:
            return known
        leg = self._leg_at(x)
        value = [
            self._objective(x),
            *leg.compute_mismatch_constraints(),
            *leg.compute_throttle_constraints(),
            *(
                float(self._end(x, k) @ self._end(x, k)) / self._ends[k][2] ** 2 - 1.0
                for k in self._bounded
            ),
            *([_LEAST_SHARE * float(x[-2]) - float(x[-1])] if self._n_shares else []),
        ]
        fitness: list[float] = self._fitness.put(point, value)
        return fitness

    def gradient(self, x: Vector) -> Vector:
        """Return the non-zero gradients in the order of `gradient_sparsity`."""
        point = x.tobytes()
        known: Vector | None = self._gradient.get(point)
        if known is not None:
            return known
        wrt_start, wrt_end, wrt_throttles = self._leg_at(x).compute_mc_grad()
        n_throttles = 3 * self.n_segments
        mismatch = np.empty((7, self._width))
        mismatch[:, :n_throttles] = wrt_throttles[:, :n_throttles]
        for k, (name, _, _) in enumerate(self._ends):
            first = n_throttles + 3 * k
            wrt_state = wrt_start if name == "rvs" else wrt_end
            mismatch[:, first : first + 3] = wrt_state[:, 3:6]
        if self.n_masses == 2:
            mismatch[:, -2] = wrt_start[:, 6]
        mismatch[:, -1] = wrt_end[:, 6]
        # |u|^2 - 1 depends on the three components of its own throttle only.
        value = np.concatenate(
            [
                [self._objective_slope(x)],
                mismatch.ravel(),
                2.0 * x[:n_throttles],
                *(2.0 * self._end(x, k) / self._ends[k][2] ** 2 for k in self._bounded),
                [_LEAST_SHARE, -1.0] if self._n_shares else [],
            ]
        )
        gradient: Vector = self._gradient.put(point, value)
        return gradient

    def gradient_sparsity(self) -> NDArray[np.int64]:
        """Return the (row, column) pairs of the non-zero gradients."""
        n_throttles = 3 * self.n_segments
        mismatch = [(1 + row, column) for row in range(7) for column in range(self._width)]
        throttles = [(8 + column // 3, column) for column in range(n_throttles)]
        excess = [
            (8 + self.n_segments + number, n_throttles + 3 * k + j)
            for number, k in enumerate(self._bounded)
            for j in range(3)
        ]
        last = 7 + self.get_nic()
        share = [(last, self._width - 2), (last, self._width - 1)] if self._n_shares else []
        return np.array([(0, self._objective_column()), *mismatch, *throttles, *excess, *share])

    @property
    def _width(self) -> int:
        return 3 * (self.n_segments + len(self._ends)) + self.n_masses

    def _leg_at(self, x: Vector) -> Any:
        throttles = x[: 3 * self.n_segments]
        # The gradient of a norm is not defined at zero, where pykep returns NaN.
        if not throttles.reshape(-1, 3).any(axis=1).all():
            throttles = np.where(throttles == 0.0, _LEAST_THROTTLE, throttles)
        self.leg.throttles = throttles
        for k, (name, state, _) in enumerate(self._ends):
            setattr(self.leg, name, [state[0].tolist(), (state[1] + self._end(x, k)).tolist()])
        self._set_masses(x)
        return self.leg

    def _set_masses(self, x: Vector) -> None:
        raise NotImplementedError

    def _objective(self, x: Vector) -> float:
        raise NotImplementedError

    def _objective_slope(self, x: Vector) -> float:
        raise NotImplementedError

    def _objective_column(self) -> int:
        raise NotImplementedError


@final
class MaximumMassProblem(_LegProblem):
    """Largest initial mass of a leg: x = throttles, initial mass, final mass.

    The objective is 1 / initial mass, because mass enters the motion as
    1 / mass only: the problem is closer to linear, and converges from more
    starts, than with the mass itself.

    Parameters
    ----------
    leg : pykep.leg.sims_flanagan
        The leg in scaled units; its mass unit should be near the answer.
    dep, arr : float
        Largest excess velocities in scaled units; 0 for none, inf for any.
    """

    n_masses = 2

    def _set_masses(self, x: Vector) -> None:
        self.leg.ms, self.leg.mf = x[-2], x[-1]

    def _objective(self, x: Vector) -> float:
        return 1.0 / float(x[-2])

    def _objective_slope(self, x: Vector) -> float:
        return -1.0 / float(x[-2]) ** 2

    def _objective_column(self) -> int:
        return self._width - 2


@final
class MinimumPropellantProblem(_LegProblem):
    """Largest final mass at the leg's own initial mass: x = throttles, final mass.

    Parameters
    ----------
    leg : pykep.leg.sims_flanagan
        The leg in scaled units, with its initial mass set.
    dep, arr : float
        As above.
    """

    n_masses = 1

    def _set_masses(self, x: Vector) -> None:
        self.leg.mf = x[-1]

    def _objective(self, x: Vector) -> float:
        return -float(x[-1])

    def _objective_slope(self, x: Vector) -> float:  # noqa: ARG002
        return -1.0

    def _objective_column(self) -> int:
        return self._width - 1
