"""`check_pruner`: tests that a pruner honours the contract of `Pruner`."""

import pickle

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, MU_SUN
from feasibility.legs import Legs
from feasibility.pruners.asking import PrunerContractError, ask
from feasibility.pruners.protocol import Pruner

_N_LEGS = 64


def check_pruner(
    pruner: Pruner, legs: Legs | None = None, *, rng: np.random.Generator | None = None
) -> None:
    """Test that `pruner` honours the contract of `Pruner`.

    To be called from the tests of whoever writes a pruner. What a pruner keeps
    is its own affair: keeping all and dropping all are both legal.

    Parameters
    ----------
    pruner : Pruner
        Pickled and called some ten times.
    legs : Legs, optional
        Legs to ask about; a varied batch of 64 is drawn where not given.
    rng : numpy.random.Generator, optional
        Draws the batch and the permutation; `default_rng(0)` where not given.

    Raises
    ------
    PrunerContractError
        The answer has the wrong shape or dtype, depends on other rows or on the
        order, changes from call to call, or changes the legs; `keep` raises, be
        it on no legs; the pruner cannot be pickled or comes back different.
    """
    generator = np.random.default_rng(0) if rng is None else rng
    batch = _varied_legs(generator) if legs is None else legs
    label = f"{type(pruner).__name__}.keep"
    before = pickle.dumps(batch)
    mask = ask(pruner, batch)
    if pickle.dumps(batch) != before:
        raise PrunerContractError(f"{label}: not pure: it changed the legs")
    if not np.array_equal(ask(pruner, batch), mask):
        raise PrunerContractError(f"{label}: not pure: two calls with the same legs differ")
    ask(pruner, batch.take(np.arange(0)))
    _check_row_wise(pruner, batch, mask, label, generator)
    try:
        twin = pickle.loads(pickle.dumps(pruner))
    except Exception as error:
        raise PrunerContractError(
            f"{type(pruner).__name__}: not picklable, so it cannot travel to worker processes "
            f"({type(error).__name__}: {error})"
        ) from error
    if not np.array_equal(ask(twin, batch), mask):
        raise PrunerContractError(f"{label}: a pickled and restored copy answers differently")


def _check_row_wise(
    pruner: Pruner,
    legs: Legs,
    mask: NDArray[np.bool_],
    label: str,
    rng: np.random.Generator,
) -> None:
    n = len(legs)
    every = np.arange(n)
    selections: list[tuple[str, NDArray[np.intp]]] = [
        ("the legs are reversed", every[::-1]),
        ("the legs are shuffled", rng.permutation(n)),
        ("the first half is asked alone", every[: n // 2]),
        ("the second half is asked alone", every[n // 2 :]),
        ("each leg is asked twice", np.repeat(every, 2)),
    ]
    selections += [(f"leg {row} is asked alone", every[row : row + 1]) for row in range(min(n, 5))]
    for what, rows in selections:
        answer = ask(pruner, legs.take(rows))
        if not np.array_equal(answer, mask[rows]):
            raise PrunerContractError(
                f"{label}: not row-wise: a leg gets another answer when {what}"
            )


def _varied_legs(rng: np.random.Generator) -> Legs:
    """Draw legs between nearly circular orbits, half in the main belt and half near the Earth."""
    n = _N_LEGS
    semi = np.where(np.arange(n) % 2 == 0, rng.uniform(2.1, 3.3, n), rng.uniform(0.8, 1.4, n)) * AU

    def log_uniform(low: float, high: float) -> NDArray[np.float64]:
        return np.exp(rng.uniform(np.log(low), np.log(high), n))

    departure = _states(rng, semi, rng.uniform(0.0, 2.0 * np.pi, n))
    tof_days = log_uniform(40.0, 1500.0)
    # Arrivals near the coasted departure body, and away from it.
    turned = tof_days * 86400.0 * np.sqrt(MU_SUN / semi**3)
    longitude = np.arctan2(departure[:, 1], departure[:, 0]) + turned
    longitude += rng.normal(0.0, 0.3, n) * rng.integers(0, 2, n)
    arrival = _states(rng, semi * rng.uniform(0.95, 1.05, n), longitude)
    m_dry = rng.uniform(300.0, 900.0, n)
    return Legs(
        rv_dep=departure,
        rv_arr=arrival,
        tof_days=tof_days,
        m0=m_dry * rng.uniform(1.0, 4.0, n),
        thrust=log_uniform(0.05, 1.0),
        isp=rng.uniform(1500.0, 5000.0, n),
        m_dry=m_dry,
    )


def _states(
    rng: np.random.Generator, radius: NDArray[np.float64], longitude: NDArray[np.float64]
) -> NDArray[np.float64]:
    n = len(radius)
    speed = np.sqrt(MU_SUN / radius)
    state = np.column_stack(
        [
            radius * np.cos(longitude),
            radius * np.sin(longitude),
            radius * rng.normal(0.0, 0.05, n),
            -speed * np.sin(longitude),
            speed * np.cos(longitude),
            speed * rng.normal(0.0, 0.05, n),
        ]
    )
    state[:, 3:] *= 1.0 + rng.normal(0.0, 0.05, (n, 1))
    return state
